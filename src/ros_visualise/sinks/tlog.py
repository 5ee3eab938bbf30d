"""Recording MAVLink to a telemetry log, which ground stations open too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import RecordingError, UsageError
from ros_visualise.data import Octets
from ros_visualise.messages.recorded import TopicType, content
from ros_visualise.sinks import Recorder
from ros_visualise.sinks.files import TargetFile


def mavlink_topics(path: Path, topics: Mapping[str, TopicType]) -> list[str]:
    """The topics of MAVLink: bytes, on topics of that name; raises UsageError without any."""
    found = [
        topic
        for topic, kind in topics.items()
        if kind.data_class is Octets and topic.endswith("/mavlink")
    ]
    if not found:
        raise UsageError(f"{path}: no topic of MAVLink to record; a vehicle has one, by --mavlink")
    return found


class TlogRecorder(Recorder):
    """Frames, each after its time: what messages hold, one after the other."""

    def __init__(self, path: Path, topics: Sequence[str], overwrite: bool) -> None:
        self._topics = tuple(topics)
        self._file = TargetFile(path, overwrite, live=True)
        self._written = 0
        self._closed = False

    @property
    def path(self) -> Path:
        return self._file.path

    @property
    def topics(self) -> tuple[str, ...]:
        return self._topics

    def write(self, topic: str, message: Any, stamp_ns: int | None = None) -> None:
        if topic not in self._topics:
            return
        if self._closed:
            raise RecordingError(f"{self.path}: the recording has ended")
        data = content(message).data.tobytes()
        try:
            self._file.require_room(len(data))
            self._file.write(data)
            self._file.keep()
            self._written += 1
        except OSError as error:
            self._closed = True
            self._file.fail()
            raise self._file.give_up(error, self._written) from None

    def close(self, whole: bool = True) -> None:
        if self._closed:
            return
        self._closed = True
        try:
            self._file.close(whole)
        except OSError as error:
            raise self._file.give_up(error, self._written) from None

    def remove(self) -> None:
        self._file.remove()
