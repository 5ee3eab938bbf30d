"""What a ROS 1 bag holds, and where."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import NamedTuple

from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.rosbag1 import records
from ros_visualise.sources.recordings.rosbag1.chunks import Chunk
from ros_visualise.sources.recordings.rosbag1.records import Damaged, Fields

_COUNT = struct.Struct("<II")
NOTES = 20  # of more damage than that, nobody reads


class Connection(NamedTuple):
    """One publisher's topic; ``type_name`` as ``sensor_msgs/msg/Image``, ``digest`` its MD5."""

    topic: str
    type_name: str
    digest: str
    definition: str
    latched: bool
    callerid: str


@dataclass
class Layout:
    """What a bag holds, and where; connections by their number, chunks in the file's order.

    ``index_position``: where its index begins, and its last chunk's index ends.
    """

    connections: dict[int, Connection] = field(default_factory=dict)
    chunks: list[Chunk] = field(default_factory=list)
    indexed: bool = True
    index_position: int = 0
    encryptor: str = ""
    loss: Loss = field(default_factory=Loss)


def parse_connection(fields: Fields, data: bytes) -> tuple[int, Connection]:
    """The number and the content of a connection's record."""
    said = records.parse_fields(data)
    package, _, name = records.text(said, b"type").partition("/")
    parts = records.text(fields, b"topic").split("/")
    found = Connection(
        topic="/" + "/".join(part for part in parts if part),
        type_name=f"{package}/msg/{name.rpartition('/')[2]}",
        digest=records.text(said, b"md5sum"),
        definition=records.text(said, b"message_definition"),
        latched=records.text(said, b"latching") == "1",
        callerid=records.text(said, b"callerid"),
    )
    return records.number(fields, b"conn"), found


def parse_chunk_info(fields: Fields, data: bytes) -> Chunk:
    """A chunk as the index at the bag's end has it."""
    if len(data) % _COUNT.size:
        raise Damaged("a chunk's counts are cut")
    counts = {connection: messages for connection, messages in _COUNT.iter_unpack(data) if messages}
    return Chunk(
        position=records.number(fields, b"chunk_pos"),
        start_ns=records.time_ns(fields, b"start_time"),
        end_ns=records.time_ns(fields, b"end_time"),
        counts=counts,
    )
