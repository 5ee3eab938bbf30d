"""MCAP files and ROS 2 bags made for tests, and what is in them by another reader."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk
from mcap.writer import CompressionType, Writer
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore

from ros_visualise.sources.recordings import Entry

ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS2 = get_typestore(Stores.ROS2_JAZZY)
STRING = "std_msgs/msg/String"


class Written(NamedTuple):
    """A message as it was written."""

    topic: str
    stamp_ns: int
    data: bytes


def text(content: str) -> bytes:
    """A ROS 2 string message."""
    return bytes(ROS2.serialize_cdr(ROS2.types[STRING](data=content), STRING))


def numbered(stamps_ns: Iterable[int], topics: Sequence[str] = ("/a", "/b", "/c")) -> list[Written]:
    """String messages at these stamps, on one topic after the other."""
    return [
        Written(topics[i % len(topics)], stamp_ns, text(f"number {i} " + "x" * (i * 7 % 50)))
        for i, stamp_ns in enumerate(stamps_ns)
    ]


def write_mcap(path: Path, messages: Iterable[Written], **options: Any) -> list[Written]:
    """String messages to an MCAP file; small chunks, unless told otherwise."""
    options = {"chunk_size": 400, "compression": CompressionType.NONE, **options}
    messages = list(messages)
    with path.open("wb") as file:
        writer = Writer(file, **options)
        writer.start("ros2")
        definition = ROS2.generate_msgdef(STRING, ros_version=2)[0]
        schema = writer.register_schema(STRING, "ros2msg", definition.encode())
        topics = sorted({message.topic for message in messages})
        channels = {t: writer.register_channel(t, "cdr", schema, {}) for t in topics}
        for topic, stamp_ns, data in messages:
            writer.add_message(channels[topic], stamp_ns, data, stamp_ns)
        writer.finish()
    return messages


def in_order(messages: Iterable[Written]) -> list[Written]:
    """By stamp, then as they were written."""
    return sorted(messages, key=lambda message: message.stamp_ns)


def written(entries: Iterable[Entry]) -> list[Written]:
    """What was read, in the form of what was written."""
    return [Written(e.topic, e.stamp_ns, bytes(e.message.data)) for e in entries]


class Part(NamedTuple):
    """A record of an MCAP file, and how many messages are in it."""

    start: int
    end: int
    kind: int
    stamps_ns: list[int]


def parts(path: Path) -> list[Part]:
    """All records of a whole MCAP file."""
    content = path.read_bytes()
    found = []
    start = 8
    while start < len(content) - 8:
        kind, length = struct.unpack_from("<BQ", content, start)
        end = start + 9 + length
        found.append(Part(start, end, kind, _stamps_ns(kind, content[start + 9 : end])))
        start = end
    return found


def _stamps_ns(kind: int, body: bytes) -> list[int]:
    if kind == Opcode.MESSAGE:
        return [struct.unpack_from("<Q", body, 6)[0]]
    if kind != Opcode.CHUNK:
        return []
    records = breakup_chunk(Chunk.read(ReadDataStream(io.BytesIO(body))))
    return [record.log_time for record in records if isinstance(record, Message)]


def latched_qos() -> Qos:
    """That of a map or of ``/tf_static``."""
    never = QosTime(0, 0)
    return Qos(
        QosHistory.KEEP_LAST,
        1,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL,
        never,
        never,
        QosLiveliness.AUTOMATIC,
        never,
        False,
    )


def write_bag(
    folder: Path,
    messages: Iterable[Written],
    storage: StoragePlugin = StoragePlugin.SQLITE3,
    version: Any = 9,
    compression: tuple[Any, Any] | None = None,
    types: dict[str, str] | None = None,
    latched: Sequence[str] = (),
) -> list[Written]:
    """Messages to a ROS 2 bag; ``types`` by topic, else they are strings."""
    messages = list(messages)
    writer = BagWriter(folder, version=version, storage_plugin=storage)
    if compression is not None:
        writer.set_compression(*compression)
    with writer:
        connections = {
            topic: writer.add_connection(
                topic,
                (types or {}).get(topic, STRING),
                typestore=ROS2,
                offered_qos_profiles=[latched_qos()] if topic in latched else [],
            )
            for topic in sorted({message.topic for message in messages})
        }
        for topic, stamp_ns, data in messages:
            writer.write(connections[topic], stamp_ns, data)
    return messages
