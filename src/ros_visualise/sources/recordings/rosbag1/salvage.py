"""Reading on where a ROS 1 bag is damaged, and noting what is lost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.rosbag1.chunks import ENTRY, Chunk, ChunkReader
from ros_visualise.sources.recordings.rosbag1.layout import NOTES
from ros_visualise.sources.recordings.rosbag1.records import Damaged


class Losses:
    """Notes once what is lost, however often it is read."""

    def __init__(self, loss: Loss) -> None:
        self._loss = loss
        self._noted: set[tuple[int, int]] = set()

    def add(self, chunk: Chunk, messages: int, why: str, offset: int = -1) -> None:
        """Messages of a chunk; ``offset`` where in it, if it is but one."""
        if (chunk.position, offset) in self._noted:
            return
        self._noted.add((chunk.position, offset))
        self._loss.messages += messages
        if len(self._loss.notes) < NOTES:
            place = f"at {chunk.position / 1e6:.1f} MB"
            self._loss.notes.append(f"{place}: {why}; messages lost: {messages}")


class Salvager:
    """Reads the chunks of an open bag; for one thread."""

    def __init__(self, file: BinaryIO, size: int, losses: Losses) -> None:
        self._reader = ChunkReader(file, size)
        self._losses = losses
        self._left: Counter[int] = Counter()

    def entries(self, chunk: Chunk) -> NDArray[Any]:
        """Where the messages of a chunk lie, as `ENTRY`."""
        try:
            entries = self._reader.entries(chunk)
        except (Damaged, OSError) as error:
            self._losses.add(chunk, chunk.messages, str(error))
            return np.empty(0, ENTRY)
        if len(entries) < chunk.messages:
            missing = chunk.messages - len(entries)
            self._losses.add(chunk, missing, "a part of a chunk is damaged")
        return entries

    def open(
        self,
        chunk: Chunk,
        start_ns: int | None,
        stop_ns: int | None,
        connections: Collection[int],
    ) -> NDArray[Any]:
        """Those messages of a chunk that `data` is going to be asked for, each once."""
        try:
            self._reader.content(chunk)
        except (Damaged, OSError) as error:
            self._losses.add(chunk, chunk.messages, str(error))
            return np.empty(0, ENTRY)
        entries = self.entries(chunk)
        wanted = np.isin(entries["connection"], list(connections))
        if start_ns is not None:
            wanted &= entries["stamp_ns"] >= start_ns
        if stop_ns is not None:
            wanted &= entries["stamp_ns"] < stop_ns
        self._left[chunk.position] = int(wanted.sum()) + 1
        self._count_down(chunk)
        return entries[wanted]

    def data(self, chunk: Chunk, entry: tuple[int, int, int]) -> bytes | None:
        """The bytes of a message; None if they are lost."""
        try:
            return self._reader.message(self._reader.content(chunk), entry)
        except (Damaged, OSError) as error:
            self._losses.add(chunk, 1, str(error), offset=entry[2])
            return None
        finally:
            self._count_down(chunk)

    def _count_down(self, chunk: Chunk) -> None:
        """Let go of a chunk's content after its last message."""
        self._left[chunk.position] -= 1
        if not self._left[chunk.position]:
            del self._left[chunk.position]
            self._reader.release(chunk.position)
