"""Recording to MCAP, as rosbag2, Foxglove and the rosbags library read it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.records import Channel, McapRecord, Message, Schema
from mcap.writer import CompressionType, Writer
from rosbags.convert.converter import LATCH
from rosbags.rosbag2.metadata import dump_qos_v8

from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks.chunked import ChunkedRecorder
from ros_visualise.sinks.encoding import Buffer, Declaration, Encoder

COMPRESSIONS = {
    "none": CompressionType.NONE,
    "lz4": CompressionType.LZ4,
    "zstd": CompressionType.ZSTD,
}
_PROFILES = {"ros1": ("ros1", "ros1msg", "ros1"), "cdr": ("ros2", "ros2msg", "cdr")}
"""Encoding -> profile of the file, encoding of its schemas and of its messages."""
_CHUNK_BYTES = 1 << 20
_CHUNK_INDEX_BYTES = 128


class McapRecorder(ChunkedRecorder):
    """Any number of topics in one .mcap; log time and publish time are the stamp.

    Chunks are compressed with LZ4 unless it is told otherwise: images of edges shrink to 2-30% in
    one to two times the time of copying them, colour video to 60-98% at 200-300 MB/s. ZSTD would
    halve the edges and save another 7-30% of the colour, at two to four times the cost: too slow
    for colour at 1080p.
    """

    def __init__(
        self,
        path: Path,
        topics: Mapping[str, TopicType],
        encoder: Encoder,
        overwrite: bool,
        compression: str = "lz4",
        live: bool = True,
    ) -> None:
        self._compression = COMPRESSIONS[compression]
        self._profile, self._schemas, self._messages = _PROFILES[encoder.encoding]
        self._shown: list[McapRecord] = []
        self._chunks = 0
        super().__init__(path, topics, encoder, overwrite, _CHUNK_BYTES, live)

    def _begin(self, declared: Mapping[str, Declaration]) -> None:
        endless = 2**62  # chunks end where we say so
        self._writer = Writer(self._file, endless, self._compression)  # type: ignore[arg-type]
        self._writer.start(self._profile)
        self._schema_ids: dict[str, int] = {}
        self._channels = {name: self._register(name, found) for name, found in declared.items()}

    def _register(self, topic: str, declared: Declaration) -> int:
        name = declared.name
        if self._profile == "ros1":
            name = name.replace("/msg/", "/")
        if name not in self._schema_ids:
            text = declared.text.encode()
            schema_id = int(self._writer.register_schema(name, self._schemas, text))
            self._schema_ids[name] = schema_id
            self._shown.append(Schema(schema_id, text, self._schemas, name))
        metadata = self._metadata(declared)
        schema_id = self._schema_ids[name]
        channel_id = int(self._writer.register_channel(topic, self._messages, schema_id, metadata))
        self._shown.append(Channel(channel_id, topic, self._messages, metadata, schema_id))
        return channel_id

    def _metadata(self, declared: Declaration) -> dict[str, str]:
        if self._profile == "ros2":
            return {"offered_qos_profiles": dump_qos_v8(LATCH) if declared.latched else ""}
        latching = {"latching": "1"} if declared.latched else {}
        return {"callerid": "/ros_visualise", "md5sum": declared.digest, **latching}

    def _append(self, topic: str, stamp_ns: int, data: Buffer) -> None:
        channel, number = self._channels[topic], self.counts[topic]
        self._last = Message(channel, stamp_ns, data, stamp_ns, number)  # type: ignore[arg-type]
        self._writer.add_message(channel, stamp_ns, data, stamp_ns, number)  # type: ignore[arg-type]

    def _show_topics(self) -> None:
        for record in self._shown:
            self._write_record(record)

    def _show(self) -> None:
        self._write_record(self._last)

    def _write_record(self, record: McapRecord) -> None:
        builder = RecordBuilder()
        record.write(builder)
        self._file.write(builder.end())  # type: ignore[no-untyped-call]

    def _write_chunk(self) -> None:
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._chunks += 1

    def _finish(self) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]

    @property
    def _index_bytes(self) -> int:
        return self._chunks * (_CHUNK_INDEX_BYTES + 10 * len(self.topics)) + sum(
            len(found.text) + 256 for found in self.declared.values()
        )
