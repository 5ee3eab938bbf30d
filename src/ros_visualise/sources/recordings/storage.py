"""One file of a recording, as `MergedRecording` reads it: in pieces, each in order of time."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from ros_visualise.messages.definitions import Definitions
from ros_visualise.sources.recordings import Entry, Extra, Loss
from ros_visualise.sources.recordings.pieces import Shelf

LATEST_NS = 2**64
"""After every stamp that a file can hold."""

_MOST_NOTES = 20


@dataclass(frozen=True)
class Channel:
    """A stream of messages on a topic; ``unreadable`` says why they can not be read, if so.

    Without definitions they can not be copied either. ``offered_qos``, ``callerid`` and
    ``labels``: as `TopicType` has them, of one publisher.
    """

    topic: str
    type_name: str
    definitions: Definitions | None = None
    digest: str = ""
    latched: bool = False
    unreadable: str = ""
    offered_qos: str = ""
    callerid: str = ""
    labels: tuple[tuple[str, str], ...] = ()

    def is_like(self, other: Channel) -> bool:
        """True if both are of one type; that of ROS 1 and ROS 2 counts as one."""
        if self.type_name != other.type_name:
            return False
        if self.definitions is None or other.definitions is None:
            return self.definitions is other.definitions
        is_same = self.definitions is other.definitions
        is_told = bool(self.digest) and self.digest == other.digest
        return is_same or is_told or self.definitions.encoding != other.definitions.encoding


class Query(NamedTuple):
    """Which messages are asked for: from a stamp until before another, of some topics or of all.

    ``chosen``: by topic, a channel of the type that is read of it.
    """

    start_ns: int = -LATEST_NS
    stop_ns: int = LATEST_NS
    topics: Collection[str] | None = None
    chosen: Mapping[str, Channel] | None = None

    @property
    def is_ever(self) -> bool:
        """True if it asks for every stamp."""
        return self.start_ns <= -LATEST_NS and self.stop_ns >= LATEST_NS

    def asks_for(self, channel: Channel) -> bool:
        """True if messages of a channel are wanted, and can be read or copied."""
        if channel.definitions is None or not (self.topics is None or channel.topic in self.topics):
            return False
        return self.chosen is None or channel.is_like(self.chosen[channel.topic])


class Piece(Protocol):
    """A part of a file that is being read, in order of the stamps, then of the file."""

    @property
    def stamp_ns(self) -> int | None:
        """That of its next message; None at its end."""

    def read(self, before_ns: int) -> Iterator[Entry]:
        """Its next messages up to a stamp; none once the file is closed."""


class StreamedPiece:
    """A `Piece` of entries that come one after the other; the next one is there already."""

    def __init__(self, entries: Iterator[Entry]) -> None:
        self._entries = entries
        self._next = next(entries, None)

    @property
    def stamp_ns(self) -> int | None:
        return None if self._next is None else self._next.stamp_ns

    def read(self, before_ns: int) -> Iterator[Entry]:
        while self._next is not None and self._next.stamp_ns < before_ns:
            entry, self._next = self._next, next(self._entries, None)
            yield entry


class Storage(Protocol):
    """A file's channels and its pieces, which are numbered in the order of the file.

    Attributes:
        size: its bytes.
        channels: by the file's own numbers.
        counts: messages of each channel.
        starts_ns, ends_ns: (N,) stamps of the first and the last message of each piece.
    """

    size: int
    channels: Mapping[int, Channel]
    counts: Mapping[int, int]
    starts_ns: npt.NDArray[np.int64]
    ends_ns: npt.NDArray[np.int64]

    @property
    def compressions(self) -> Collection[str]:
        """Those that it uses: ``none``, ``bz2``, ``lz4``, ``zstd``."""

    def select(self, query: Query) -> npt.NDArray[np.intp]:
        """The pieces that may hold what is asked for, in the order of the file."""

    def open_piece(self, piece: int, query: Query, shelf: Shelf) -> Piece:
        """Read the messages of a piece that are asked for; ``shelf``: that of all who are read."""

    def stamps_ns(self) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        """Channels and stamps of their messages, those of one channel in any number of arrays."""

    def extras(self) -> Iterator[Extra]:
        """As `Recording.extras`."""

    def close(self) -> None:
        """Let go of the file; may be called from any thread."""


def add_note(loss: Loss, note: str) -> None:
    """Say what was lost, unless much of that kind was said already."""
    if len(loss.notes) < _MOST_NOTES and note not in loss.notes:
        loss.notes.append(note)
    elif len(loss.notes) == _MOST_NOTES:
        loss.notes.append("and more")
