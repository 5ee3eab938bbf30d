"""Reading films, folders and recordings, and converting them."""

from __future__ import annotations

import logging
import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Generic, Literal, NamedTuple, TypeVar, overload

from ros_visualise.api.trajectories import PoseTrajectory, as_arrays
from ros_visualise.core.errors import (
    DamagedMessage,
    OpenError,
    RecordingError,
    UsageError,
    did_you_mean,
)
from ros_visualise.core.message import Message
from ros_visualise.data import Image, Pixels
from ros_visualise.messages.recorded import content
from ros_visualise.sinks.conversion import begin_conversion, choose_part
from ros_visualise.sinks.names import check_targets
from ros_visualise.sources import open_source
from ros_visualise.sources.recordings.images import image_topic
from ros_visualise.sources.trajectories import read_trajectory

log = logging.getLogger(__name__)

M = TypeVar("M", bound=Message)
FilePath = str | PathLike[str]


@dataclass(frozen=True)
class Sample(Generic[M]):
    """A message of a recording: its topic, when it was recorded (ns), and its content."""

    topic: str
    stamp_ns: int
    message: M


class Frame(NamedTuple):
    """An image: its stamp (ns), its pixels (height, width[, channels]), and their encoding."""

    stamp_ns: int
    pixels: Pixels
    encoding: str


class SourceTopic(NamedTuple):
    """A topic of a source: the ROS type of its messages, and their number; 0 if unknown."""

    type: str
    messages: int


class OpenSource:
    """A film, a folder or a recording that is open; `open` makes it.

    Attributes:
        path: the file or folder.
        format: such as ``mcap`` or ``rosbag 2.0``.
        topics: name -> type and number of its messages.
        start_ns, end_ns: stamps of the first and the last message.
        damaged: messages that could not be decoded, and were skipped.
    """

    def __init__(self, path: FilePath) -> None:
        self._recording = open_source(path)
        self.path = self._recording.path
        self.format = self._recording.format
        self.topics: Mapping[str, SourceTopic] = {
            name: SourceTopic(info.type.name, info.messages)
            for name, info in self._recording.topics.items()
        }
        self.start_ns, self.end_ns = self._recording.start_ns, self._recording.end_ns
        self.damaged = 0

    def __enter__(self) -> OpenSource:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def duration_s(self) -> float:
        """Time from the first to the last message, seconds."""
        return (self.end_ns - self.start_ns) / 1e9

    @property
    def losses(self) -> tuple[str, ...]:
        """Unreadable parts, as far as they have been read: a line each."""
        return tuple(self._recording.loss.notes)

    @overload
    def messages(
        self,
        topics: str | Collection[str] = ...,
        *,
        start_s: float = ...,
        end_s: float | None = ...,
    ) -> Iterator[Sample[Message]]: ...

    @overload
    def messages(
        self,
        topics: str | Collection[str] = ...,
        *,
        kind: type[M],
        start_s: float = ...,
        end_s: float | None = ...,
    ) -> Iterator[Sample[M]]: ...

    def messages(
        self,
        topics: str | Collection[str] = (),
        *,
        kind: type[Any] = Message,
        start_s: float = 0.0,
        end_s: float | None = None,
    ) -> Iterator[Sample[Any]]:
        """The messages in order of their stamps; damaged ones are skipped, counted and logged.

        Args:
            topics: a topic or several; empty: all whose messages are of this kind.
            kind: class of the messages, as `ros_visualise.data.Odometry`.
            start_s, end_s: range of time, seconds since the first message.

        Raises:
            UsageError: no such topic, or its messages are of another kind.
        """
        wanted = self._wanted([topics] if isinstance(topics, str) else topics, kind)
        begin_ns = self.start_ns + round(start_s * 1e9) if start_s else None
        stop_ns = None if end_s is None else self.start_ns + round(end_s * 1e9)
        with closing(self._recording.read(begin_ns, stop_ns, wanted)) as entries:
            for entry in entries:
                try:
                    message = content(entry.message)
                except DamagedMessage as error:
                    if not self.damaged:
                        log.warning("%s: %s (further occurrences suppressed)", entry.topic, error)
                    self.damaged += 1
                else:
                    yield Sample(entry.topic, entry.stamp_ns, message)

    def frames(
        self, topic: str | None = None, *, start_s: float = 0.0, end_s: float | None = None
    ) -> Iterator[Frame]:
        """The images of a topic, by default of the first in gray or colour; see `messages`."""
        chosen = image_topic(self._recording, topic)
        for sample in self.messages(chosen, kind=Image, start_s=start_s, end_s=end_s):
            image = sample.message
            yield Frame(sample.stamp_ns, image.pixels, image.encoding)

    def trajectory(self, topic: str | None = None) -> PoseTrajectory:
        """The trajectory on a topic or of a pair of frames; see `ros_visualise.api.trajectory`."""
        return as_arrays(read_trajectory(self._recording, topic))

    def close(self) -> None:
        """Close its files, and log what of them could not be read."""
        self._recording.close()
        for note in self.losses:
            log.warning("%s: %s", self.path, note)

    def _wanted(self, topics: Collection[str], kind: type[Message]) -> list[str]:
        known = self._recording.topics
        for topic in topics:
            if topic not in known:
                raise UsageError(f"{self.path}: no topic {topic!r}{did_you_mean(topic, known)}")
            found = known[topic].type.data_class
            if not issubclass(found, kind) and kind is not Message:
                raise UsageError(f"{topic}: its messages are {found.__name__}, not {kind.__name__}")
        return [
            *(topics or (t for t, info in known.items() if issubclass(info.type.data_class, kind)))
        ]


def open(path: FilePath) -> OpenSource:
    """Open a film, a folder of pictures or a recording; use it in a ``with`` statement.

    Raises:
        OpenError: it cannot be opened.
    """
    return OpenSource(path)


@overload
def messages(
    path: FilePath,
    topics: str | Collection[str] = ...,
    *,
    start_s: float = ...,
    end_s: float | None = ...,
) -> Iterator[Sample[Message]]: ...


@overload
def messages(
    path: FilePath,
    topics: str | Collection[str] = ...,
    *,
    kind: type[M],
    start_s: float = ...,
    end_s: float | None = ...,
) -> Iterator[Sample[M]]: ...


def messages(
    path: FilePath,
    topics: str | Collection[str] = (),
    *,
    kind: type[Any] = Message,
    start_s: float = 0.0,
    end_s: float | None = None,
) -> Iterator[Sample[Any]]:
    """The messages of a source, which is opened and closed; see `OpenSource.messages`."""
    with open(path) as source:
        yield from source.messages(topics, kind=kind, start_s=start_s, end_s=end_s)


def frames(
    path: FilePath, topic: str | None = None, *, start_s: float = 0.0, end_s: float | None = None
) -> Iterator[Frame]:
    """The images of a source, which is opened and closed; see `OpenSource.frames`."""
    with open(path) as source:
        yield from source.frames(topic, start_s=start_s, end_s=end_s)


@dataclass(frozen=True)
class Converted:
    """A recording that `convert` wrote.

    Attributes:
        path: the new file or folder.
        messages: topic -> number of written messages.
        losses: what could not be read or written, a line each; empty: nothing.
    """

    path: Path
    messages: Mapping[str, int]
    losses: tuple[str, ...]


def convert(
    source: FilePath,
    target: FilePath,
    *,
    topics: Collection[str] = (),
    start_s: float | None = None,
    duration_s: float | None = None,
    compression: str | None = None,
    profile: Literal["ros1", "ros2"] | None = None,
    overwrite: bool = False,
) -> Converted:
    """Write a recording, or a part of it, in another format.

    Args:
        source: a recording of any kind, or a video.
        target: a ``.bag`` or ``.mcap``; a name without these suffixes makes a ROS 2 folder.
        topics: these alone; empty: all.
        start_s, duration_s: range of time, seconds since the first message.
        compression, profile: as of ``ros-visualise convert``.
        overwrite: replace a target that exists.

    Raises:
        OpenError: the source cannot be read, or the target exists or cannot be written.
        UsageError: unknown topic, compression or kind of file.
        RecordingError: the target could not be written to its end.
    """
    path = Path(target)
    if os.path.lexists(path) and not overwrite:
        raise OpenError(f"{path} exists; choose another name, or give overwrite=True")
    check_targets([path], source if isinstance(source, str) else Path(source))
    with closing(open_source(source)) as recording:
        part = choose_part(recording, topics, start_s, duration_s)
        conversion = begin_conversion(
            recording, part, path, profile=profile, compression=compression, overwrite=overwrite
        )
        conversion.run()
    if conversion.recorder.path != path:
        raise RecordingError(f"{path} unchanged; partial output in {conversion.recorder.path}")
    return Converted(path, dict(conversion.written), tuple(conversion.losses))
