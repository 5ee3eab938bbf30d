"""Recordings of many topics: bags, MCAP files, KITTI folders, flight logs.

`open_recording` finds out what a path is by looking at it, whatever its name.
"""

from __future__ import annotations

from collections.abc import Collection, Generator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from ros_visualise.messages.recorded import TopicType


class Entry(NamedTuple):
    """One message of a recording, and when it was recorded.

    ``message`` is a `ros_visualise.messages.recorded.Recorded` or, where the recording holds no ROS
    messages, one of `ros_visualise.data.MESSAGES`.
    """

    topic: str
    stamp_ns: int
    message: Any


@dataclass(frozen=True)
class TopicInfo:
    """What a recording says of a topic; ``messages`` counts those that are there.

    ``digest`` is the MD5 or hash of its type as the recording has it. ``readable`` is empty, or
    says why its messages can not be read.
    """

    type: TopicType
    messages: int
    digest: str = ""
    connections: int = 1
    unreadable: str = ""


@dataclass
class Loss:
    """What of a recording could not be read, as far as it was read by now.

    ``notes`` are for people, a line each: ``cut off after 12.3 of 40.1 MB``.
    """

    messages: int = 0
    bytes: int = 0
    notes: list[str] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.messages or self.bytes or self.notes)


class Recording(Protocol):
    """An opened recording; one thread at a time reads it.

    Attributes:
        path: the file or folder.
        format: for people and ``info``: ``rosbag 2.0``, ``mcap``, ``rosbag2``, ``KITTI raw``.
        size: bytes of all its files.
        compression: ``none``, ``lz4``, ``bz2``, ``zstd``, or several joined by ``, ``.
        start_ns, end_ns: stamps of the first and the last message; equal where there is none.
        topics: by name, in the order of their names.
        loss: what could not be read.
    """

    path: Path
    format: str
    size: int
    compression: str
    start_ns: int
    end_ns: int
    topics: Mapping[str, TopicInfo]
    loss: Loss

    def read(
        self,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Generator[Entry, None, None]:
        """The messages in order of their stamps; of equal stamps, in the order of the file.

        Args:
            start_ns, stop_ns: the first stamp, and the one before which to end; absolute times.
            topics: of these alone.
        """

    def close(self) -> None:
        """Let go of its files; may be called from any thread."""


def open_recording(path: str | Path) -> Recording:
    """Open what is there.

    Raises:
        OpenError: there is nothing, or nothing that can be read; the message says what to do.
    """
    raise NotImplementedError
