"""Recording to MCAP, as rosbag2, Foxglove and the rosbags library read it.

Source: the specification at mcap.dev. The mcap library makes all records but chunks. Its `Writer`
keeps a chunk in memory until that is flushed. If the process is killed, what came before a silence
is lost where stamps decide when to flush (a map that comes once, for example); and where the clock
decides, the same messages make another file each time. For small messages it takes twice as long.
"""

from __future__ import annotations

import struct
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.sinks import SinkSettings
from ros_visualise.sinks.chunked import OWN_NAME, ChunkedRecorder
from ros_visualise.sinks.encoding import Buffer, TopicDeclaration
from ros_visualise.sources.recordings import Extra

_COMPRESS: dict[str, Callable[[bytes], bytes]] = {
    "none": bytes,
    "lz4": lz4.frame.compress,
    "zstd": partial(zstandard.compress, level=1),  # small messages: faster, and not larger than 3
}
_LARGE_BYTES = 32 * 1024  # of a message, as of images and scans
_PROFILES = {"ros1": ("ros1", "ros1msg", "ros1"), "cdr": ("ros2", "ros2msg", "cdr")}
"""Encoding -> profile of the file, encoding of its schemas and of its messages."""
_CHUNK_INDEX_BYTES = 128
_LATEST_NS = 2**64 - 1
_MESSAGE = struct.Struct("<BQHIQQ")
_MESSAGE_OP = int(Opcode.MESSAGE)  # looking it up in the enumeration takes long
_MESSAGE_FIELDS_BYTES = _MESSAGE.size - struct.calcsize("<BQ")
_CHUNK = struct.Struct("<BQQQQII")
_CHUNK_FIELDS_BYTES = _CHUNK.size - struct.calcsize("<BQ")
_MESSAGE_INDEX = struct.Struct("<BQHI")
_FOOTER_START = struct.Struct("<BQQQ")


@dataclass
class _McapChunk:
    """The current chunk: its records, and channel -> stamp and offset of each message."""

    parts: list[Buffer] = field(default_factory=list)
    size: int = 0
    index: defaultdict[int, list[int]] = field(default_factory=lambda: defaultdict(list))


class McapRecorder(ChunkedRecorder):
    """Any number of topics in one .mcap; new messages are published when they are logged.

    By default, chunks of small messages are compressed with ZSTD, and those of large ones, such as
    images, with LZ4: edges shrink to 2-30% in one to two times the time of copying
    them, colour video to 60-98% at 200-300 MB/s. ZSTD would halve the edges and save another 7-30%
    of the colour, at two to four times the cost: too slow for colour at 1080p.
    """

    full_bytes = 1 << 20
    head_bytes = _MESSAGE.size

    def __init__(self, path: Path, topics: Mapping[str, TopicType], settings: SinkSettings) -> None:
        self._compression = settings.compression
        self._profile, self._schema_encoding, self._encoding = _PROFILES[settings.encoding]
        self._schemas: dict[tuple[str, bytes], Schema] = {}
        self._channels: dict[str, Channel] = {}
        self._numbers: dict[str, int] = {}
        self._chunk = _McapChunk()
        self._chunk_indexes: list[bytes] = []
        self._attachment_indexes: list[AttachmentIndex] = []
        self._metadata_indexes: list[MetadataIndex] = []
        super().__init__(path, topics, settings)

    def _begin(self, declared: Mapping[str, TopicDeclaration]) -> None:
        for topic, found in declared.items():
            self._register(topic, found)
        header = Header(self._profile, "ros_visualise")
        topics = [header, *self._schemas.values(), *self._channels.values()]
        self._file.write(MCAP0_MAGIC + _records(topics))

    def _declare(self, topic: str, declared: TopicDeclaration) -> None:
        known = len(self._schemas)
        self._register(topic, declared)
        schemas = list(self._schemas.values())[known:]
        self._file.write(_records([*schemas, self._channels[topic]]))

    def _register(self, topic: str, declared: TopicDeclaration) -> None:
        name = declared.name
        if self._profile == "ros1":
            name = name.replace("/msg/", "/")
        number = len(self._schemas) + 1
        text = declared.text.encode()
        schema = Schema(number, text, self._schema_encoding, name)
        schema = self._schemas.setdefault((name, text), schema)
        self._numbers[topic] = len(self._numbers) + 1
        self._channels[topic] = Channel(
            id=self._numbers[topic],
            topic=topic,
            message_encoding=self._encoding,
            metadata=self._metadata(declared),
            schema_id=schema.id,
        )

    def _metadata(self, declared: TopicDeclaration) -> dict[str, str]:
        """Metadata as rosbag2 or ROS 1 write it, and what the source recording has of the other."""
        topic, callerid = declared.topic, self._publisher(declared.topic)
        if self._profile == "ros2":
            named = {"callerid": callerid} if callerid else {}
            return {"offered_qos_profiles": declared.offered_qos, **named, **dict(topic.labels)}
        found = {"callerid": callerid or OWN_NAME, "md5sum": declared.digest, **dict(topic.labels)}
        found |= {"latching": "1"} if topic.qos.transient_local else {}
        return found | ({"offered_qos_profiles": topic.offered_qos} if topic.offered_qos else {})

    def add_extra(self, extra: Extra) -> None:
        record = _records([extra])
        self._require_open()
        self._require_room(len(record))
        self._write_between(lambda: self._write_extra(extra, record))

    def _write_extra(self, extra: Extra, record: bytes) -> None:
        place = self._file.tell(), len(record)
        self._file.write(record)
        if isinstance(extra, Attachment):
            times, size = (extra.log_time, extra.create_time), len(extra.data)
            found = AttachmentIndex(*place, *times, size, extra.name, extra.media_type)
            self._attachment_indexes.append(found)
        else:
            self._metadata_indexes.append(MetadataIndex(*place, extra.name))

    def _append(self, topic: str, stamp_ns: int, data: Buffer, message: Any) -> None:
        chunk, channel, size = self._chunk, self._numbers[topic], _MESSAGE_FIELDS_BYTES + len(data)
        number, sent_ns = 0, stamp_ns
        if isinstance(message, Recorded):
            number, delay_ns = message.sequence, message.stamp_ns - message.publish_ns
            if delay_ns:
                sent_ns = min(max(stamp_ns - delay_ns, 0), _LATEST_NS)
        chunk.parts += _MESSAGE.pack(_MESSAGE_OP, size, channel, number, stamp_ns, sent_ns), data
        chunk.index[channel] += stamp_ns, chunk.size
        chunk.size += _MESSAGE.size + len(data)

    def _show(self) -> None:
        self._file.write(b"".join(self._chunk.parts[-2:]))

    def _write_chunk(self, first_ns: int, last_ns: int) -> None:
        chunk, self._chunk = self._chunk, _McapChunk()
        content = b"".join(chunk.parts)
        compression = self._compression_of(chunk)
        compressed = _COMPRESS[compression](content)
        name = b"" if compression == "none" else compression.encode()
        head = _CHUNK.pack(
            Opcode.CHUNK,
            _CHUNK_FIELDS_BYTES + len(name) + 8 + len(compressed),
            first_ns,
            last_ns,
            len(content),
            zlib.crc32(content),
            len(name),
        )
        head += name + struct.pack("<Q", len(compressed))
        indexes = {channel: _message_index(channel, e) for channel, e in chunk.index.items()}
        self._file.write(head)
        self._file.write(compressed)
        self._file.write(b"".join(indexes.values()))
        length = len(head) + len(compressed)
        offsets, position = {}, self._end + length
        for channel, index in indexes.items():
            offsets[channel] = position
            position += len(index)
        found = ChunkIndex(
            chunk_length=length,
            chunk_start_offset=self._end,
            compression=name.decode(),
            compressed_size=len(compressed),
            message_end_time=last_ns,
            message_index_length=position - self._end - length,
            message_index_offsets=offsets,
            message_start_time=first_ns,
            uncompressed_size=len(content),
        )
        self._chunk_indexes.append(_records([found]))

    def _compression_of(self, chunk: _McapChunk) -> str:
        if self.unthrottled:
            return "none"
        if self._compression != "auto":
            return self._compression
        messages = len(chunk.parts) // 2
        return "lz4" if chunk.size >= _LARGE_BYTES * messages else "zstd"

    def _finish(self) -> None:
        self._file.write(_records([DataEnd(0)]))
        start = position = self._file.tell()
        groups = {
            Opcode.SCHEMA: _records(self._schemas.values()),
            Opcode.CHANNEL: _records(self._channels.values()),
            Opcode.STATISTICS: _records([self._statistics()]),
            Opcode.CHUNK_INDEX: b"".join(self._chunk_indexes),
            Opcode.ATTACHMENT_INDEX: _records(self._attachment_indexes),
            Opcode.METADATA_INDEX: _records(self._metadata_indexes),
        }
        offsets = []
        for opcode, group in groups.items():
            if group:
                offsets.append(SummaryOffset(opcode, position, len(group)))
            position += len(group)
        summary = b"".join(groups.values()) + _records(offsets)
        footer = _FOOTER_START.pack(Opcode.FOOTER, 8 + 8 + 4, start, position)
        crc = zlib.crc32(footer, zlib.crc32(summary))
        self._file.write(summary + _records([Footer(start, position, crc)]) + MCAP0_MAGIC)

    def _statistics(self) -> Statistics:
        count = sum(self.counts.values())
        return Statistics(
            attachment_count=len(self._attachment_indexes),
            channel_count=len(self._channels),
            channel_message_counts={c.id: self.counts[t] for t, c in self._channels.items()},
            chunk_count=len(self._chunk_indexes),
            message_count=count,
            message_end_time=self.end_ns,
            message_start_time=self.start_ns if count else 0,
            metadata_count=len(self._metadata_indexes),
            schema_count=len(self._schemas),
        )

    @property
    def _index_bytes(self) -> int:
        extras = [*self._attachment_indexes, *self._metadata_indexes]
        return (
            len(self._chunk_indexes) * (_CHUNK_INDEX_BYTES + 10 * len(self.topics))
            + sum(len(found.text) + 256 for found in self.declared.values())
            + len(_records(extras))
        )


def _records(records: Iterable[McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data


def _message_index(channel: int, entries: list[int]) -> bytes:
    """The index of a channel's messages; entries are stamps and offsets in turn."""
    size = 8 * len(entries)
    head = _MESSAGE_INDEX.pack(Opcode.MESSAGE_INDEX, 2 + 4 + size, channel, size)
    return head + struct.pack(f"<{len(entries)}Q", *entries)
