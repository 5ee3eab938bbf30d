"""The topics of a ROS 1 bag, and the types of their messages."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

from ros_visualise.errors import DamagedMessage
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.recordings import TopicInfo
from ros_visualise.sources.recordings.rosbag1.layout import Connection

_SEPARATOR = re.compile(r"^=+\s*\nMSG: *([\w/]+) *\n", re.MULTILINE)
_EMPTY_MD5 = "d41d8cd98f00b204e9800998ecf8427e"  # of a type without fields


class KnownType(NamedTuple):
    """How the messages of a connection are read; ``unreadable`` says why they cannot be."""

    type_name: str
    definitions: Definitions
    unreadable: str


class Types:
    """The types of all connections of a bag, each as the connection itself defines it.

    Nearly always one set of definitions serves them all; where two connections define a type
    differently, as after a change of the message, each has its own set.
    """

    def __init__(self) -> None:
        self._sets: list[tuple[Definitions, dict[str, str]]] = []
        self._known: dict[tuple[str, str, str], KnownType] = {}

    def of(self, connection: Connection) -> KnownType:
        """How its messages are read."""
        key = (connection.type_name, connection.digest, connection.definition)
        if key not in self._known:
            definitions = self._fitting(_texts(connection.type_name, connection.definition))
            unreadable = _define(definitions, connection)
            self._known[key] = KnownType(connection.type_name, definitions, unreadable)
        return self._known[key]

    def _fitting(self, texts: Mapping[str, str]) -> Definitions:
        for definitions, given in self._sets:
            if all(given.get(name, text) == text for name, text in texts.items()):
                given.update(texts)
                return definitions
        self._sets.append((Definitions("ros1"), dict(texts)))
        return self._sets[-1][0]


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


def _define(definitions: Definitions, connection: Connection) -> str:
    """Add a connection's type; why its messages cannot be read, else nothing."""
    name = connection.type_name
    is_given = bool(connection.definition.strip()) or connection.digest == _EMPTY_MD5
    problem = f"the bag does not define {name}"
    if is_given:
        try:
            definitions.define(name, connection.definition)
            return ""
        except DamagedMessage as error:
            problem = str(error)
    if definitions.knows(name) and definitions.digest(name) == connection.digest:
        return ""  # as ROS itself defines it
    return problem


def _texts(type_name: str, definition: str) -> dict[str, str]:
    """The definition of each type in a definition, its own first."""
    own, *others = _SEPARATOR.split(definition)
    texts = {type_name: own.strip()}
    for name, text in zip(others[::2], others[1::2], strict=True):
        texts[name] = text.strip()
    return texts
