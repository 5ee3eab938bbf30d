"""The topics of a ROS 1 bag, and the types of their messages."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from ros_visualise.errors import DamagedMessage
from ros_visualise.messages.definitions import Definitions, Undecoded
from ros_visualise.messages.qos import LATCHED, VOLATILE
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.recordings import TopicInfo, left_out
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
        return KnownType(type_name, Undecoded("ros1", text, digest, problem), problem)


class Topics:
    """The topics of a bag. Each is of one type, which can be read, and has messages, if any has.

    Attributes:
        by_name: in the order of their names.
        known: how the messages of each connection are read that is of its topic's type.
        left_out: of the others, how many messages there are and what to say of them.
    """

    def __init__(self, connections: Mapping[int, Connection], counts: Mapping[int, int]) -> None:
        self.by_name: dict[str, TopicInfo] = {}
        self.known: dict[int, KnownType] = {}
        self.left_out: list[tuple[int, str]] = []
        self._connections, self._counts = connections, counts
        self._types = Types()
        numbers: dict[str, list[int]] = {}
        for number, connection in connections.items():
            numbers.setdefault(connection.topic, []).append(number)
        for topic in sorted(numbers):
            self.by_name[topic] = self._add(topic, numbers[topic])

    def _add(self, topic: str, numbers: list[int]) -> TopicInfo:
        of, connections = self._types.of, self._connections
        chosen = min(
            numbers, key=lambda n: (bool(of(connections[n]).unreadable), not self._counts.get(n))
        )
        known = of(connections[chosen])
        alike = [n for n in numbers if self._are_alike(connections[n], connections[chosen])]
        self.known |= dict.fromkeys(alike, known)
        others = [n for n in numbers if n not in alike]
        for number in others:
            if count := self._counts.get(number, 0):
                name = connections[number].type_name
                self.left_out.append((count, left_out(topic, count, name, known.type_name)))
        return TopicInfo(
            type=TopicType(
                known.type_name,
                known.definitions,
                LATCHED if any(connections[n].latched for n in alike) else VOLATILE,
            ),
            messages=sum(self._counts.get(n, 0) for n in alike),
            digest=connections[chosen].digest,
            connections=len(numbers),
            unreadable=known.unreadable,
            other_types={connections[n].type_name: connections[n].digest for n in others},
        )

    def _are_alike(self, one: Connection, other: Connection) -> bool:
        if one.type_name != other.type_name:
            return False
        known = self._types.of(one)
        is_same = not known.unreadable and known.definitions is self._types.of(other).definitions
        return is_same or one.digest == other.digest
