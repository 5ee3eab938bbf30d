"""The types of the messages of a ROS 1 bag, each as the connection itself defines it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.messages.definitions import Definitions, Undecoded
from ros_visualise.sources.recordings.rosbag1.layout import Connection
from ros_visualise.sources.recordings.schemas import Schemas
from ros_visualise.sources.recordings.storage import Channel

_EMPTY_MD5 = "d41d8cd98f00b204e9800998ecf8427e"  # of a type without fields
_EMPTY_TEXT = "# it has no fields"


def describe(connections: Mapping[int, Connection], schemas: Schemas) -> dict[int, Channel]:
    """The connections of a bag as their messages are to be read.

    Args:
        schemas: those of the recording, to which theirs are added.
    """

    @cache
    def define(type_name: str, digest: str, text: str) -> tuple[Definitions, str]:
        return _define(schemas, type_name, digest, text)

    found = {}
    for number, one in connections.items():
        definitions, unreadable = define(one.type_name, one.digest, one.definition)
        found[number] = Channel(
            one.topic,
            one.type_name,
            definitions,
            one.digest,
            one.latched,
            unreadable,
            callerid=one.callerid,
        )
    return found


def _define(schemas: Schemas, type_name: str, digest: str, text: str) -> tuple[Definitions, str]:
    """How messages of a type are read, and why they cannot be; empty: they can."""
    if not text.strip() and digest == _EMPTY_MD5:
        text = _EMPTY_TEXT
    try:
        found = schemas.define("ros1", type_name, text)
        problem = f"{type_name}: the bag does not define it, and ROS has another one"
    except DamagedMessage as error:
        found = Definitions("ros1")
        problem = str(error)
    else:
        if text.strip():
            return found, ""
    if found.knows(type_name) and found.digest(type_name) == digest:
        return found, ""  # as ROS itself defines it
    return Undecoded("ros1", text, digest, problem), problem
