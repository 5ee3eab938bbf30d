"""Recording to MCAP with ROS 2 types, as rosbag2, Foxglove and the rosbags library read it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from ros_visualise.data import ParameterEvent
from ros_visualise.errors import RecordingError
from ros_visualise.messages import to_message, type_name
from ros_visualise.sinks import PARAMETER_EVENTS
from ros_visualise.sinks.files import DISK_FULL, TargetFile, recording_failed

_INDEX_BYTES = 256  # what one message adds to the index at the file's end, at most


@cache
def _typestore() -> Typestore:
    return get_typestore(Stores.ROS2_JAZZY)


class McapRecorder:
    """Any number of topics in one .mcap; log time and publish time are the header's stamp.

    Each message is a chunk of its own and is handed to the system at once. So a process that is
    killed loses nothing that it had written, and the file does not depend on how fast it was made.

    Chunks are compressed with LZ4: images of edges shrink to 2-30% in one to two times the time of
    copying them, colour video to 60-98% at 200-300 MB/s. ZSTD would halve the edges and save
    another 7-30% of the colour, at two to four times the cost: too slow for colour at 1080p.
    """

    def __init__(self, path: Path, topics: Mapping[str, type], overwrite: bool) -> None:
        self.path = path
        recorded = {**topics, PARAMETER_EVENTS: ParameterEvent}
        self.topics = tuple(recorded)
        self._written = dict.fromkeys(recorded, 0)
        self._closed = False
        self._file = TargetFile(path, overwrite)
        self._writer = Writer(self._file, chunk_size=0, compression=CompressionType.LZ4)  # type: ignore[arg-type]
        try:
            self._channels = self._begin(recorded)
            self._file.keep()
        except OSError as error:
            raise self._fail(error) from None

    def write(self, topic: str, message: Any) -> None:
        """Record a message at its stamp; as `ros_visualise.sinks.Recorder`."""
        if topic not in self._channels:
            return
        if self._closed:
            raise RecordingError(f"{self.path}: the recording has ended")
        types = _typestore()
        data = types.serialize_cdr(to_message(message, types.types), type_name(type(message)))
        if not self._file.has_room(len(data) + len(data) // 128 + _INDEX_BYTES * self._count):
            self.close()
            raise recording_failed(self.path, DISK_FULL, self._count)
        try:
            self._add(topic, message.header.stamp_ns, data)
        except OSError as error:
            raise self._fail(error) from None

    def close(self) -> None:
        """Write the index and close the file."""
        if self._closed:
            return
        self._closed = True
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
        except OSError as error:
            raise self._fail(error) from None
        self._file.close()

    def __enter__(self) -> McapRecorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def _count(self) -> int:
        return sum(self._written.values())

    def _begin(self, topics: Mapping[str, type]) -> dict[str, int]:
        """Write the file's start: topic -> channel."""
        self._writer.start("ros2")
        schemas = {cls: self._register_schema(type_name(cls)) for cls in topics.values()}
        return {
            topic: self._writer.register_channel(
                topic, "cdr", schemas[cls], {"offered_qos_profiles": ""}
            )
            for topic, cls in topics.items()
        }

    def _register_schema(self, ros_type: str) -> int:
        definition, _ = _typestore().generate_msgdef(ros_type, ros_version=2)
        return int(self._writer.register_schema(ros_type, "ros2msg", definition.encode()))

    def _add(self, topic: str, stamp_ns: int, data: Any) -> None:
        self._writer.add_message(
            self._channels[topic], stamp_ns, data, stamp_ns, self._written[topic]
        )
        self._file.keep()
        self._written[topic] += 1

    def _fail(self, error: OSError) -> RecordingError:
        self._closed = True
        self._file.fail()
        self._file.close()
        return recording_failed(self.path, error, self._count)
