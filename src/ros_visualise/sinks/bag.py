"""Recording to ROS 1 bags of version 2.0.

Source: "Bags/Format/2.0" in the ROS wiki. The rosbags library writes bags too, but keeps a chunk
in memory until it is full, so that a killed process loses it.
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import lz4.frame  # type: ignore[import-untyped]
from mcap.records import Attachment

from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.sinks import SinkSettings
from ros_visualise.sinks.chunked import OWN_NAME, ChunkedRecorder
from ros_visualise.sinks.encoding import Buffer, TopicDeclaration, qos_profile
from ros_visualise.sources.recordings import Extra

_MAGIC = b"#ROSBAG V2.0\n"
_BAG_HEADER_BYTES = 4096  # padded, so that it can be rewritten, also by rosbag reindex
_MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 4, 5, 6, 7
_NS = 1_000_000_000
_U32 = struct.Struct("<I").pack
_TIME = struct.Struct("<II").pack
_LAST_FIELD = _U32(len(b"time=") + 8) + b"time="


def _compress_lz4(data: bytes) -> bytes:
    """Independent blocks and a checksum at the end, as ROS's own reader requires."""
    compressed: bytes = lz4.frame.compress(
        data, block_linked=False, content_checksum=True, store_size=False
    )
    return compressed


_COMPRESS: dict[str, Callable[[bytes], bytes]] = {
    "none": bytes,
    "lz4": _compress_lz4,
    "bz2": bz2.compress,
}


class BagRecorder(ChunkedRecorder):
    """Any number of topics in one .bag, as `rosbag record` writes it."""

    full_bytes = 768 * 1024  # as rosbag does
    head_bytes = 46

    def __init__(self, path: Path, topics: Mapping[str, TopicType], settings: SinkSettings) -> None:
        self._compression = settings.compression
        self._numbers: dict[str, int] = {}
        self._prefixes: dict[str, bytes] = {}
        self._connections: dict[str, bytes] = {}
        self._seen: set[str] = set()
        self._chunk_infos: list[bytes] = []
        self._chunk = _BagChunk()
        super().__init__(path, topics, settings)

    def _begin(self, declared: Mapping[str, TopicDeclaration]) -> None:
        for topic, found in declared.items():
            self._declare(topic, found)
        self._file.write(_MAGIC + self._bag_header(0))

    def _declare(self, topic: str, declared: TopicDeclaration) -> None:
        self._numbers[topic] = number = len(self._numbers)
        self._prefixes[topic] = _fields(op=bytes([_MESSAGE]), conn=_U32(number))
        self._connections[topic] = self._connection(topic, declared)
        profiles = declared.topic.offered_qos.strip()
        if profiles and profiles != qos_profile(
            declared.topic.qos
        ):  # a latched topic has that one anyway
            self._unplaced["QoS profile"] += 1
        if declared.topic.labels:
            self._unplaced["topic label"] += len(declared.topic.labels)

    def _connection(self, topic: str, declared: TopicDeclaration) -> bytes:
        header = _fields(
            op=bytes([_CONNECTION]), conn=_U32(self._numbers[topic]), topic=topic.encode()
        )
        latching = {"latching": b"1"} if declared.topic.qos.transient_local else {}
        about = _fields(
            topic=topic.encode(),
            type=declared.name.replace("/msg/", "/").encode(),
            md5sum=declared.digest.encode(),
            message_definition=declared.text.encode(),
            callerid=(self._publisher(declared.topic) or OWN_NAME).encode(),
            **latching,
        )
        return _record(header, about)

    def add_extra(self, extra: Extra) -> None:
        self._unplaced["attachment" if isinstance(extra, Attachment) else "metadata record"] += 1

    def _append(self, topic: str, stamp_ns: int, data: Buffer, message: Any) -> None:
        if isinstance(message, Recorded):
            self._count_unplaced(message)
        chunk = self._chunk
        self._shown_from = len(chunk.parts)
        if topic not in self._seen:  # readers of an unfinished file need it before its messages
            self._seen.add(topic)
            chunk.add(self._connections[topic])
        time = _time(stamp_ns)
        chunk.index.setdefault(topic, []).append(time + _U32(chunk.size))
        prefix = self._prefixes[topic]
        length = len(prefix) + len(_LAST_FIELD) + len(time)
        chunk.add(_U32(length) + prefix + _LAST_FIELD + time + _U32(len(data)))
        chunk.add(data)

    def _count_unplaced(self, message: Recorded) -> None:
        if message.sequence:
            self._unplaced["sequence number"] += 1
        if message.publish_ns != message.stamp_ns:
            self._unplaced["sending time"] += 1

    def _show(self) -> None:
        """Extend the uncompressed chunk at the end of the file, and its index after it."""
        size = self._chunk.size
        added = b"".join(self._chunk.parts[self._shown_from :])
        start = _chunk_start("none", size, size)
        self._file.seek(self._end + len(start) + size - len(added))
        self._file.write(added + self._chunk_index(self._chunk))
        self._file.seek(self._end)
        self._file.write(start)

    def _write_chunk(self, first_ns: int, last_ns: int) -> None:
        chunk, self._chunk = self._chunk, _BagChunk()
        content = b"".join(chunk.parts)
        compression = "none" if self.unthrottled else self._compression
        compressed = _COMPRESS[compression](content)
        self._file.write(_chunk_start(compression, len(content), len(compressed)))
        self._file.write(compressed)
        self._file.write(self._chunk_index(chunk))
        header = _fields(
            op=bytes([_CHUNK_INFO]),
            ver=_U32(1),
            chunk_pos=struct.pack("<Q", self._end),
            start_time=_time(first_ns),
            end_time=_time(last_ns),
            count=_U32(len(chunk.index)),
        )
        counts = [_U32(self._numbers[t]) + _U32(len(found)) for t, found in chunk.index.items()]
        self._chunk_infos.append(_record(header, b"".join(counts)))

    def _chunk_index(self, chunk: _BagChunk) -> bytes:
        """Offsets of the messages of each topic in a chunk."""
        return b"".join(_index(self._numbers[t], found) for t, found in chunk.index.items())

    def _finish(self) -> None:
        index_pos = self._file.tell()
        self._file.write(b"".join(self._connections.values()))
        self._file.write(b"".join(self._chunk_infos))
        self._file.seek(len(_MAGIC))
        self._file.write(self._bag_header(index_pos))

    @property
    def _index_bytes(self) -> int:
        topics = sum(map(len, self._connections.values()))
        return topics + (len(self._chunk_infos) + 1) * (128 + 8 * len(self._connections))

    def _bag_header(self, index_pos: int) -> bytes:
        header = _fields(
            op=bytes([_BAG]),
            index_pos=struct.pack("<Q", index_pos),
            conn_count=_U32(len(self._connections)),
            chunk_count=_U32(len(self._chunk_infos)),
        )
        blanks = b" " * (_BAG_HEADER_BYTES - len(header))
        return _record(header, blanks)


@dataclass
class _BagChunk:
    """The current chunk: its records, and offsets of the messages of each topic in them."""

    parts: list[Buffer] = field(default_factory=list)
    size: int = 0
    index: dict[str, list[bytes]] = field(default_factory=dict)

    def add(self, part: Buffer) -> None:
        """Append bytes."""
        self.parts.append(part)
        self.size += len(part)


def _time(stamp_ns: int) -> bytes:
    return _TIME(*divmod(max(stamp_ns, 1), _NS))  # ROS does not play a message of time 0


def _chunk_start(compression: str, size: int, compressed_size: int) -> bytes:
    header = _fields(op=bytes([_CHUNK]), compression=compression.encode(), size=_U32(size))
    return _U32(len(header)) + header + _U32(compressed_size)


def _fields(**values: bytes) -> bytes:
    pairs = [name.encode() + b"=" + value for name, value in values.items()]
    return b"".join(_U32(len(pair)) + pair for pair in pairs)


def _record(header: bytes, data: bytes) -> bytes:
    return _U32(len(header)) + header + _U32(len(data)) + data


def _index(number: int, entries: list[bytes]) -> bytes:
    header = _fields(op=bytes([_INDEX]), ver=_U32(1), conn=_U32(number), count=_U32(len(entries)))
    return _record(header, b"".join(entries))
