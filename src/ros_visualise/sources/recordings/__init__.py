"""Recordings of many topics: bags, MCAP files, KITTI folders, flight logs; what they share.

`ros_visualise.sources.opening.open_recording` opens one.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from mcap.records import Attachment, Metadata
from numpy.typing import NDArray

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.messages.recorded import TopicType, content

Extra = Attachment | Metadata
"""Content of a recording beside its messages: a file, or texts by name, in the form of MCAP."""

_MOST_NOTES = 20


class Entry(NamedTuple):
    """One message of a recording, and when it was recorded.

    ``message`` is a `ros_visualise.messages.recorded.Recorded` or, where the recording holds no ROS
    messages, one of `ros_visualise.data`.
    """

    topic: str
    stamp_ns: int
    message: Any


@dataclass(frozen=True)
class TopicInfo:
    """A topic of a recording; ``messages`` counts the recorded ones.

    ``digest`` is the MD5 or hash of its type as the recording has it. ``unreadable`` is empty,
    or says why its messages cannot be read. ``other_types``: name -> digest of the types whose
    messages are skipped, as the topic is of ``type``.
    """

    type: TopicType
    messages: int
    digest: str = ""
    connections: int = 1
    unreadable: str = ""
    other_types: Mapping[str, str] = field(default_factory=dict)


@dataclass
class Loss:
    """Unreadable content of a recording, as far as it has been read.

    ``notes`` are for people, a line each: ``cut off after 12.3 of 40.1 MB``. There is one wherever
    something is lost, also an unknown amount.
    """

    messages: int = 0
    bytes: int = 0
    notes: list[str] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.notes)

    def add(self, note: str = "", messages: int = 0, size: int = 0) -> None:
        """Count lost messages and bytes; notes are kept once each, and up to a number."""
        self.messages += messages
        self.bytes += size
        if note and len(self.notes) < _MOST_NOTES and note not in self.notes:
            self.notes.append(note)
        elif note and len(self.notes) == _MOST_NOTES:
            self.notes.append("and more")


class PartialLoss(NamedTuple):
    """The loss of one file of a recording; each note begins with its label."""

    whole: Loss
    label: str = ""

    def add(self, note: str = "", messages: int = 0, size: int = 0) -> None:
        """Count lost messages and bytes of this file, as `Loss.add`."""
        self.whole.add(note and f"{self.label}{note}", messages, size)

    def absorb(self, found: Loss) -> None:
        """Count all that was found lost in this file."""
        self.add("", found.messages, found.bytes)
        for note in found.notes:
            self.add(note)


KeyImage = Callable[[int], tuple[int, Any] | None]
"""The stamp and the image of the key image before a stamp, or None."""


@runtime_checkable
class ImageAt(Protocol):
    """A recording whose image at a time is found without reading those before, as of a film.

    Attributes:
        key_image: stamp and image of the key image before a stamp; None: unknown.
    """

    key_image: KeyImage | None

    def image_at(self, stamp_ns: int) -> Entry:
        """The last image not after a stamp, else the first."""


class Recording(Protocol):
    """An opened recording; one thread at a time reads it.

    Attributes:
        path: the file or folder.
        format: for people and ``info``: ``rosbag 2.0``, ``mcap``, ``rosbag2``, ``KITTI raw``.
        size: bytes of all its files.
        start_ns, end_ns: stamps of the first and the last message; equal without messages.
        topics: by name, in the order of their names.
    """

    path: Path
    format: str
    size: int
    start_ns: int
    end_ns: int
    topics: Mapping[str, TopicInfo]

    @property
    def loss(self) -> Loss:
        """Messages and bytes that could not be read."""

    @property
    def compression(self) -> str:
        """``none``, ``lz4``, ``bz2``, ``zstd``, or several joined by ``, ``."""

    def read(
        self,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Generator[Entry, None, None]:
        """The messages in order of their stamps; of equal stamps, in the order of the file.

        Args:
            start_ns, stop_ns: the first stamp, and the one before which to end; absolute times.
            topics: only these.
        """

    def stamps_ns(self) -> Mapping[str, NDArray[np.int64]]:
        """The stamps of each topic's messages in their order, from the index if possible."""

    def extras(self) -> Iterator[Extra]:
        """Content beside the messages, in the order of the file; damaged extras are a loss."""

    def close(self) -> None:
        """Close its files; may be called from any thread, and ends all reading."""


def readable(recording: Recording, topics: Collection[str]) -> Generator[Entry, None, None]:
    """The messages of some topics in order, decoded as ours; damaged ones are skipped."""
    with closing(recording.read(topics=topics)) as entries:
        for topic, stamp_ns, message in entries:
            try:
                found = content(message)
            except DamagedMessage:
                continue
            yield Entry(topic, stamp_ns, found)
