"""Recording some topics to one file, as a whole or message by message."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import RecordingError
from ros_visualise.sinks import Recorder
from ros_visualise.sinks.files import TargetFile


class FileRecorder(Recorder):
    """Hands each message of its topics to `_take`, and has `_end` complete the file."""

    def __init__(self, path: Path, topics: Sequence[str], overwrite: bool, live: bool) -> None:
        self._topics = tuple(topics)
        self._file = TargetFile(path, overwrite, live)
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
        self._take(topic, message, stamp_ns)

    def close(self, whole: bool = True) -> None:
        if self._closed:
            return
        self._closed = True
        try:
            self._end()
            self._file.close(whole)
        except OSError as error:
            raise self._file.give_up(error, self._written) from None

    def remove(self) -> None:
        self._file.remove()

    @abstractmethod
    def _take(self, topic: str, message: Any, stamp_ns: int | None) -> None:
        """Record a message; raises as `write`."""

    def _end(self) -> None:
        """Write what is left; may raise OSError."""


class AppendingRecorder(FileRecorder):
    """Writes what `_encoded` makes of each message; if writing fails, whole messages stay."""

    def _take(self, topic: str, message: Any, stamp_ns: int | None) -> None:
        data = self._encoded(message)
        try:
            self._file.require_room(len(data))
            self._file.write(data)
            self._file.keep()
            self._written += 1
        except OSError as error:
            self._closed = True
            self._file.fail()
            raise self._file.give_up(error, self._written) from None

    @abstractmethod
    def _encoded(self, message: Any) -> bytes:
        """The bytes of a message."""
