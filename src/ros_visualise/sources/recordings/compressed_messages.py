"""Files whose messages are compressed one by one, as rosbag2 does it when told to."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import TooLarge
from ros_visualise.sources.recordings import Entry, Extra, Loss
from ros_visualise.sources.recordings.shelf import Shelf
from ros_visualise.sources.recordings.storage import Piece, Query, Storage, add_note
from ros_visualise.sources.recordings.unpacking import DamagedData, unpack_all

_ZSTD = b"\x28\xb5\x2f\xfd"
_CDR = b"\0"
"""How messages begin that are not compressed."""
_CDR_BYTES = 4


class CompressedMessages:
    """A `Storage` that decompresses those messages of another that are compressed with zstd.

    Args:
        storage: where they are.
        loss: where to say what cannot be decompressed.
        is_known: whether the bag says that it compresses its messages.
    """

    def __init__(self, storage: Storage, loss: Loss, is_known: bool) -> None:
        self._storage, self._loss, self._is_known = storage, loss, is_known
        self._lost: set[tuple[str, int]] = set()
        self.size, self.channels, self.counts = storage.size, storage.channels, storage.counts
        self.starts_ns, self.ends_ns = storage.starts_ns, storage.ends_ns
        self.compressions: Collection[str] = ("zstd",) if is_known else storage.compressions

    def select(self, query: Query) -> npt.NDArray[np.intp]:
        """As `Storage.select`."""
        return self._storage.select(query)

    def open_piece(self, piece: int, query: Query, shelf: Shelf) -> Piece:
        """As `Storage.open_piece`."""
        return _DecompressedPiece(self._storage.open_piece(piece, query, shelf), self._decompress)

    def stamps_ns(self) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        """As `Storage.stamps_ns`."""
        return self._storage.stamps_ns()

    def extras(self) -> Iterator[Extra]:
        """As `Storage.extras`."""
        return self._storage.extras()

    def close(self) -> None:
        """As `Storage.close`."""
        self._storage.close()

    def _decompress(self, entry: Entry) -> bool:
        """Decompress a message if it is compressed; whether that could be done."""
        message = entry.message
        if message.data[:4] == _ZSTD:
            try:
                message.data = unpack_all("zstd", message.data)
            except DamagedData:
                self._lose(entry, "messages whose zstd data is damaged")
                return False
            except TooLarge as error:
                self._lose(entry, f"{entry.topic}: a message {error}")
                return False
        elif self._is_known and (message.data[:1] != _CDR or len(message.data) < _CDR_BYTES):
            self._lose(entry, "messages that are neither zstd data nor CDR")
            return False
        return True

    def _lose(self, entry: Entry, why: str) -> None:
        if (entry.topic, entry.stamp_ns) not in self._lost:
            self._lost.add((entry.topic, entry.stamp_ns))
            self._loss.messages += 1
            add_note(self._loss, why)


class _DecompressedPiece:
    def __init__(self, piece: Piece, decompress: Callable[[Entry], bool]) -> None:
        self._piece, self._decompress = piece, decompress

    @property
    def stamp_ns(self) -> int | None:
        return self._piece.stamp_ns

    def read(self, before_ns: int) -> Iterator[Entry]:
        return filter(self._decompress, self._piece.read(before_ns))
