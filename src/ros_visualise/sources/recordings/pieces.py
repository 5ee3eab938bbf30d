"""Reading a chunk of a file, or a run of messages outside chunks, message by message."""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable, Iterator, Mapping, Sequence

from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded
from ros_visualise.sources.recordings import Entry

_CAPACITY_BYTES = 96 << 20

Records = bytes | memoryview
"""The bytes of one record after another."""

Place = tuple[int, int, int, int, int, int]
"""A message among records: its stamp, its channel, start and stop of its bytes, when it was sent,
and its number."""


class PieceCache:
    """Memory for pieces that are read in turns; the least recently filled is emptied first.

    One that is larger than all of the memory may have that alone.
    """

    def __init__(self, capacity: int = _CAPACITY_BYTES) -> None:
        self._capacity = capacity
        self._sizes: OrderedDict[ChunkPiece, int] = OrderedDict()
        self._users = 0

    @property
    def share(self) -> int:
        """The bytes that each of the present users can keep at the same time."""
        return self._capacity // max(1, self._users)

    def join(self) -> None:
        """Count one user more."""
        self._users += 1

    def leave(self, piece: ChunkPiece) -> None:
        """Count one user less."""
        self._users -= 1
        self._sizes.pop(piece, None)
        piece.forget()

    def keep(self, piece: ChunkPiece, size: int) -> None:
        """Count the bytes that a piece keeps now, instead of those before."""
        self._sizes.pop(piece, None)
        self._sizes[piece] = size
        while sum(self._sizes.values()) > self._capacity and len(self._sizes) > 1:
            oldest, _ = self._sizes.popitem(last=False)
            oldest.forget()


class FileRange:
    """A part of a file that is too large for memory; ``read`` gives bytes from a place on."""

    def __init__(self, read: Callable[[int, int], bytes], start: int, end: int) -> None:
        self._read, self._start, self._end = read, start, end

    def __len__(self) -> int:
        return self._end - self._start

    def __getitem__(self, part: slice) -> bytes:
        start, stop, _ = part.indices(len(self))
        return self._read(self._start + start, stop - start)


class ChunkPiece:
    """A `Piece`. If many are read in turns, each keeps only its share of messages, the next ones.

    Args:
        places: its messages, in order of time.
        channels: topic, type and definitions of them.
        records: in which the places are.
        load: gives the records again; None if they cannot be read any more.
        cache: shared by all pieces that are read in turns.
    """

    def __init__(
        self,
        places: Sequence[Place],
        channels: Mapping[int, tuple[str, str, Definitions]],
        records: Records | FileRange,
        load: Callable[[], Records | FileRange | None],
        cache: PieceCache,
    ) -> None:
        self._places, self._channels = places, channels
        self._load, self._cache = load, cache
        self._next = 0
        self._records: memoryview | FileRange | None = None
        self._ahead: deque[bytes] = deque()
        if places:
            cache.join()
            self._keep(records)

    @property
    def stamp_ns(self) -> int | None:
        return self._places[self._next][0] if self._next < len(self._places) else None

    def read(self, before_ns: int) -> Iterator[Entry]:
        places, channels, count = self._places, self._channels, len(self._places)
        while self._next < count:
            stamp_ns, number, start, stop, publish_ns, sequence = places[self._next]
            if stamp_ns >= before_ns:
                return
            data = self._data(start, stop)
            self._next = count if data is None else self._next + 1
            if self._next == count:
                self._cache.leave(self)
            if data is not None:
                topic, name, definitions = channels[number]
                message = Recorded(name, data, definitions, stamp_ns, None, publish_ns, sequence)
                yield Entry(topic, stamp_ns, message)

    def forget(self) -> None:
        """Free its memory; it is loaded again when it is needed."""
        self._records = None
        self._ahead.clear()

    def _data(self, start: int, stop: int) -> bytes | memoryview | None:
        """The bytes of the next message."""
        if self._records is None and not self._ahead:
            records = self._load()
            if records is None:
                return None
            self._keep(records)
        if self._records is None:
            return self._ahead.popleft()
        data = self._records[start:stop]
        if len(data) < stop - start:  # the file has become shorter
            return None
        is_most = 2 * len(data) > len(self._records)  # then it needs no copy
        return data if is_most else bytes(data)

    def _keep(self, records: Records | FileRange) -> None:
        """Keep all of the piece if that is no more than its share; else the next messages."""
        share = self._cache.share
        if isinstance(records, FileRange):
            self._records = records
            return
        if len(records) <= share:
            self._records = memoryview(records)
            self._cache.keep(self, len(records))
            return
        size = 0
        for index in range(self._next, len(self._places)):
            start, stop = self._places[index][2:4]
            size += stop - start
            if size > share and self._ahead:
                size -= stop - start
                break
            self._ahead.append(bytes(records[start:stop]))
        self._cache.keep(self, size)
