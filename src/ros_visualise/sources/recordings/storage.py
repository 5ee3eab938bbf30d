"""One file of a recording, as `MergedRecording` reads it: in pieces, each in order of time."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from ros_visualise.messages.definitions import Definitions
from ros_visualise.sources.recordings import Entry, Extra
from ros_visualise.sources.recordings.pieces import PieceCache

LATEST_NS = 2**64
"""After every stamp that a file can hold."""

_MOST_NS = 2**63
"""After every stamp that an index holds."""

Readable = tuple[str, str, Definitions]
"""Topic, type and definitions of messages."""


@dataclass(frozen=True)
class Channel:
    """A stream of messages on a topic; ``unreadable`` says why they cannot be read, if so.

    Without definitions they cannot be copied either. ``offered_qos``, ``callerid`` and
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
        is_alike = bool(self.digest) and self.digest == other.digest
        return is_same or is_alike or self.definitions.encoding != other.definitions.encoding


class MessageQuery(NamedTuple):
    """Selection of messages: from a stamp until before another, of some topics or of all.

    ``chosen``: by topic, a channel of the type that is read of it.
    """

    start_ns: int = -LATEST_NS
    stop_ns: int = LATEST_NS
    topics: Collection[str] | None = None
    chosen: Mapping[str, Channel] | None = None

    @property
    def is_ever(self) -> bool:
        """True if it selects every stamp."""
        return self.start_ns <= -LATEST_NS and self.stop_ns >= LATEST_NS

    def selects(self, channel: Channel) -> bool:
        """True if messages of a channel are selected, and can be read or copied."""
        if channel.definitions is None or not (self.topics is None or channel.topic in self.topics):
            return False
        return self.chosen is None or channel.is_like(self.chosen[channel.topic])

    def readable(self, channels: Mapping[int, Channel]) -> dict[int, Readable]:
        """The selected channels by number."""
        return {
            number: (channel.topic, channel.type_name, channel.definitions)
            for number, channel in channels.items()
            if self.selects(channel) and channel.definitions
        }

    def is_within(
        self, starts_ns: npt.NDArray[np.int64], ends_ns: npt.NDArray[np.int64]
    ) -> npt.NDArray[np.bool_]:
        """(N,) true for pieces from one stamp to another that may have selected messages."""
        found = np.ones(len(starts_ns), bool)
        if self.start_ns > -_MOST_NS:
            found &= ends_ns >= self.start_ns
        if self.stop_ns < _MOST_NS:
            found &= starts_ns < self.stop_ns
        return found


class Piece(Protocol):
    """A part of a file that is being read, in order of the stamps, then of the file."""

    @property
    def stamp_ns(self) -> int | None:
        """Stamp of its next message; None at its end."""

    def read(self, before_ns: int) -> Iterator[Entry]:
        """Its next messages up to a stamp; none once the file is closed."""


class StreamedPiece:
    """A `Piece` of entries that come one after the other; the next one is read ahead."""

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

    def select(self, query: MessageQuery) -> npt.NDArray[np.intp]:
        """The pieces that may hold selected messages, in the order of the file."""

    def open_piece(self, piece: int, query: MessageQuery, cache: PieceCache) -> Piece:
        """Read the selected messages of a piece; all pieces of a query share the cache."""

    def stamps_ns(self) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        """Channels and stamps of their messages, those of one channel in any number of arrays."""

    def extras(self) -> Iterator[Extra]:
        """See `Recording.extras`."""

    def close(self) -> None:
        """Close the file; may be called from any thread."""
