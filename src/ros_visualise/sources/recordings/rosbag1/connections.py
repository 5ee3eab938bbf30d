"""The topics of a ROS 1 bag, and the types of their messages."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from ros_visualise.errors import DamagedMessage
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.recordings import TopicInfo
from ros_visualise.sources.recordings.rosbag1.layout import Connection
from ros_visualise.sources.recordings.schemas import Schemas

_EMPTY_MD5 = "d41d8cd98f00b204e9800998ecf8427e"  # of a type without fields
_EMPTY_TEXT = "# it has no fields"


class KnownType(NamedTuple):
    """How the messages of a connection are read; ``unreadable`` says why they cannot be."""

    type_name: str
    definitions: Definitions
    unreadable: str = ""


class Types:
    """The types of all connections of a bag, each as the connection itself defines it."""

    def __init__(self) -> None:
        self._schemas = Schemas()
        self._known: dict[tuple[str, str, str], KnownType] = {}

    def of(self, connection: Connection) -> KnownType:
        """How its messages are read."""
        key = connection[1:4]
        if key not in self._known:
            self._known[key] = self._find(*key)
        return self._known[key]

    def _find(self, type_name: str, digest: str, text: str) -> KnownType:
        if not text.strip() and digest == _EMPTY_MD5:
            text = _EMPTY_TEXT
        try:
            found = KnownType(type_name, self._schemas.define("ros1", type_name, text))
            problem = f"{type_name}: the bag does not define it, and ROS has another one"
        except DamagedMessage as error:
            found = KnownType(type_name, Definitions("ros1"))
            problem = str(error)
        else:
            if text.strip():
                return found
        if found.definitions.knows(type_name) and found.definitions.digest(type_name) == digest:
            return found  # as ROS itself defines it
        return found._replace(unreadable=problem)


def topics_of(
    connections: Mapping[int, Connection], counts: Mapping[int, int], types: Types
) -> dict[str, TopicInfo]:
    """The topics by name; where connections differ, the first one's type is the topic's."""
    numbers: dict[str, list[int]] = {}
    for number, connection in connections.items():
        numbers.setdefault(connection.topic, []).append(number)
    return {
        topic: _topic(
            [connections[number] for number in numbers[topic]],
            sum(counts.get(number, 0) for number in numbers[topic]),
            types,
        )
        for topic in sorted(numbers)
    }


def _topic(connections: list[Connection], messages: int, types: Types) -> TopicInfo:
    first = connections[0]
    known = types.of(first)
    latched = any(connection.latched for connection in connections)
    return TopicInfo(
        type=TopicType(known.type_name, known.definitions, latched),
        messages=messages,
        digest=first.digest,
        connections=len(connections),
        unreadable=known.unreadable,
    )
