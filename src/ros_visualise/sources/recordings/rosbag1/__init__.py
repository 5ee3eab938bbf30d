"""ROS 1 bags of version 2.0, read without ROS, also cut, damaged or never closed.

A bag's index tells of every chunk how many messages of which topics it holds, from when to when.
That alone is read at first; where the messages lie in a chunk is read when their time comes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Generator, Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from ros_visualise.errors import OpenError
from ros_visualise.messages.recorded import Recorded
from ros_visualise.sources.recordings import Entry, Extra, TopicInfo
from ros_visualise.sources.recordings.calibrations import calibrated
from ros_visualise.sources.recordings.rosbag1 import records
from ros_visualise.sources.recordings.rosbag1.chunks import Chunk, ChunkReader
from ros_visualise.sources.recordings.rosbag1.connections import Topics
from ros_visualise.sources.recordings.rosbag1.index import read_layout
from ros_visualise.sources.recordings.rosbag1.layout import Layout
from ros_visualise.sources.recordings.rosbag1.order import in_time_order
from ros_visualise.sources.recordings.rosbag1.records import Damaged
from ros_visualise.sources.recordings.rosbag1.salvage import Losses, Salvager

_BUFFER = 1 << 16
_INDEX_BUFFER = 1 << 12  # of a file that is read in many small and distant pieces


def open_rosbag1(path: str | Path) -> RosBag:
    """Open a ROS 1 bag.

    Raises:
        OpenError: nothing of it can be read; the message says what to do.
    """
    return RosBag(Path(path))


class RosBag:
    """A ROS 1 bag, a `ros_visualise.sources.recordings.Recording`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._closed = False
        with self._open(_BUFFER) as file:
            self.size = path.stat().st_size
            layout = _read_layout(path, file, self.size)
        self.format = "rosbag 2.0" if layout.indexed else "rosbag 2.0, unindexed"
        self._connections, self._chunks = layout.connections, layout.chunks
        counts = _count(self._chunks)
        topics = Topics(self._connections, counts)
        self.topics: Mapping[str, TopicInfo] = topics.by_name
        self._known = topics.known
        self.start_ns = min((chunk.start_ns for chunk in self._chunks), default=0)
        self.end_ns = max((chunk.end_ns for chunk in self._chunks), default=0)
        self.loss = layout.loss
        self._losses = Losses(self.loss)
        nameless = sum(counts[number] for number in counts.keys() - self._connections.keys())
        if nameless:
            self.loss.messages += nameless
            self.loss.notes.append(f"{nameless} messages of topics that the bag does not name")
        for messages, note in topics.left_out:
            self.loss.messages += messages
            self.loss.notes.append(note)

    @cached_property
    def compression(self) -> str:
        """The compressions of its chunks, that of most of them first."""
        found: Counter[str] = Counter()
        with self._open(_INDEX_BUFFER) as file:
            reader = ChunkReader(file, self.size)
            for chunk in self._chunks:
                try:
                    fields = {} if chunk.bare_end else reader.header(chunk.position).fields
                except (Damaged, OSError):
                    continue
                found[records.text(fields, b"compression") or "none"] += 1
        return ", ".join(name for name, _ in found.most_common()) or "none"

    def read(
        self,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Generator[Entry, None, None]:
        """As `Recording.read`.

        Raises:
            OpenError: the file is not there any more.
        """
        return calibrated(self._read, self.topics, start_ns, stop_ns, topics)

    def stamps_ns(self) -> Mapping[str, NDArray[np.int64]]:
        """As `Recording.stamps_ns`."""
        found: dict[str, list[NDArray[np.int64]]] = {topic: [] for topic in self.topics}
        with self._open(_INDEX_BUFFER) as file:
            salvager = Salvager(file, self.size, self._losses)
            for chunk in self._chunks:
                entries = salvager.entries(chunk)
                for number in chunk.counts.keys() & self._known.keys():
                    stamps = entries["stamp_ns"][entries["connection"] == number]
                    found[self._connections[number].topic].append(stamps)
        return {
            topic: np.sort(np.concatenate([np.empty(0, np.int64), *parts]), kind="stable")
            for topic, parts in found.items()
        }

    def extras(self) -> Iterator[Extra]:
        """As `Recording.extras`; there is nothing."""
        return iter(())

    def close(self) -> None:
        """End what is being read."""
        self._closed = True

    def _read(
        self, start_ns: int | None, stop_ns: int | None, topics: Collection[str] | None
    ) -> Generator[Entry, None, None]:
        wanted = {
            number: (self._connections[number].topic, known)
            for number, known in self._known.items()
            if topics is None or self._connections[number].topic in topics
        }
        chunks = [
            chunk
            for chunk in self._chunks
            if (start_ns is None or chunk.end_ns >= start_ns)
            and (stop_ns is None or chunk.start_ns < stop_ns)
            and not wanted.keys().isdisjoint(chunk.counts)
        ]
        with self._open(_BUFFER) as file:
            salvager = Salvager(file, self.size, self._losses)
            places = in_time_order(
                chunks, lambda chunk: salvager.open(chunk, start_ns, stop_ns, wanted)
            )
            for stamp_ns, number, offset, place in places:
                if self._closed:
                    return
                data = salvager.data(chunks[place], (stamp_ns, number, offset))
                if data is not None:
                    topic, known = wanted[number]
                    message = Recorded(known.type_name, data, known.definitions, stamp_ns)
                    yield Entry(topic, stamp_ns, message)

    def _open(self, buffering: int) -> BinaryIO:
        try:
            return self.path.open("rb", buffering)
        except PermissionError:
            raise OpenError(f"{self.path}: you may not read it; try chmod u+r") from None
        except OSError as error:
            raise OpenError(f"{self.path}: {error.strerror or error}; check the path") from None


def _read_layout(path: Path, file: BinaryIO, size: int) -> Layout:
    magic = file.read(len(records.MAGIC))
    if magic != records.MAGIC:
        if magic.startswith(b"#ROSBAG V") and len(magic) == len(records.MAGIC):
            raise OpenError(
                f"{path}: of another version than 2.0; with ROS: rosbag filter {path} NEW.bag True"
            )
        raise OpenError(f"{path}: no ROS 1 bag, or cut off; copy or record it again")
    layout = read_layout(file, size)
    if layout.encryptor:
        raise OpenError(f"{path}: encrypted; decrypt it first, with ROS: rosbag decrypt {path}")
    return layout


def _count(chunks: Iterable[Chunk]) -> Counter[int]:
    counts: Counter[int] = Counter()
    for chunk in chunks:
        counts.update(chunk.counts)
    return counts
