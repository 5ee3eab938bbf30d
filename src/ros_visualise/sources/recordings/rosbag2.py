"""ROS 2 bags: folders of SQLite or MCAP files with a ``metadata.yaml``, or without it."""

from __future__ import annotations

import os
import re
import tempfile
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import zstandard
from mcap.records import Metadata as MetadataRecord

from ros_visualise.core.errors import OpenError, TooLarge
from ros_visualise.core.limits import check_disk
from ros_visualise.core.regular_files import natural, open_file
from ros_visualise.sources.recordings import Entry, Loss, PartialLoss, Recording
from ros_visualise.sources.recordings.mcap_file import McapFile
from ros_visualise.sources.recordings.merging import (
    MergedRecording,
    missing_parts,
    open_storages,
)
from ros_visualise.sources.recordings.metadata import CUSTOM, METADATA, Metadata, read_metadata
from ros_visualise.sources.recordings.pieces import PieceCache
from ros_visualise.sources.recordings.schemas import Schemas
from ros_visualise.sources.recordings.sqlite_file import SqliteFile
from ros_visualise.sources.recordings.storage import MessageQuery, Piece, Storage
from ros_visualise.sources.recordings.unpacking import DamagedData, unpack_all

_PACKED = ".zstd"
_FILES = (".db3", ".mcap")
_PART = re.compile(r"(.*_)\d+\.\w+(?:\.zstd)?")
_BLOCK_BYTES = 8 << 20
_MAX_METADATA = 4 << 20  # bytes
_ZSTD = b"\x28\xb5\x2f\xfd"
_CDR = b"\0"
"""Beginning of messages that are not compressed."""
_CDR_BYTES = 4


def open_rosbag2(path: Path) -> Recording:
    """Open a ROS 2 bag: its folder, or one of its SQLite files; raises OpenError.

    Where ``metadata.yaml`` and the files differ, the files count.
    """
    loss = Loss()
    if path.is_dir():
        metadata = read_metadata(path)
        files = _files(path, metadata, loss)
    else:
        metadata, files = Metadata(), [path]
    declared = metadata.by_topic if len(files) == 1 else {}
    with ExitStack() as stack:
        storages: Sequence[Storage] = open_storages(
            path, files, partial(_open_file, stack, declared), loss, stack
        )
        packed = metadata.compression_mode == "message"
        if packed or metadata.compression_mode is None:
            storages = [CompressedMessages(storage, loss, packed) for storage in storages]
        if metadata.damaged:
            loss.add(metadata.damaged)
        _compare(metadata, list(zip(files, storages, strict=False)), loss)
        release = stack.pop_all().close
    compression = "zstd" if any(file.suffix == _PACKED for file in files) else ""
    extras = [MetadataRecord(CUSTOM, dict(metadata.custom))] if metadata.custom else []
    recording = MergedRecording(path, "rosbag2", storages, loss, release, compression, extras)
    recording.size = sum(file.stat().st_size for file in files)
    return recording


def open_whole(path: Path) -> Recording:
    """Open a ROS 2 bag; a file that its folder's metadata names stands for the folder."""
    return open_rosbag2(path.parent if path.is_file() and _is_listed(path) else path)


def are_parts(files: Sequence[Path]) -> bool:
    """True if they are named as parts of one bag: ``NAME_0.db3``, ``NAME_1.db3``, ..."""
    names = {re.sub(r"_\d+(?=\.\w+$)", "", file.name) for file in files}
    return len(names) == 1 and {file.suffix for file in files} <= {*_FILES}


def _is_listed(path: Path) -> bool:
    """True if the folder's metadata names a file."""
    metadata = path.parent / METADATA
    if not metadata.is_file():
        return False
    with open_file(metadata) as file:
        return os.fsencode(path.name) in file.read(_MAX_METADATA)


def _files(folder: Path, metadata: Metadata, loss: Loss) -> list[Path]:
    """The named files that exist; if one is missing or none is named, also the others."""
    names = dict.fromkeys(re.split(r"[/\\]", name)[-1] for name in metadata.files)
    found = [folder / name for name in names if (folder / name).is_file()]
    for name in names:
        if folder / name not in found:
            loss.add(f"{name} is missing")
    if len(found) < len(names) or not names:
        found += _others(folder, found)
    for name in missing_parts(found) if not names else ():
        loss.add(f"{name} is missing")
    for file in _others(folder, found) if names else ():
        if _stem(file) in map(_stem, found):
            loss.add(f"{file.name} is not listed in {METADATA}")
    if not found:
        raise OpenError(f"{folder}: no .db3 or .mcap file in it; give the folder of a ROS 2 bag")
    return found


def _others(folder: Path, named: Sequence[Path]) -> list[Path]:
    kinds = {_kind(file) for file in named} or set(_FILES)
    there = {item for item in folder.iterdir() if item.is_file() and _kind(item) in kinds}
    packed_twins = {f for f in there if f.suffix == _PACKED and f.with_suffix("") in there}
    return sorted(there - packed_twins - set(named), key=natural)


def _stem(file: Path) -> str:
    """Common name of the parts of one bag: ``bag_`` of ``bag_1.db3``."""
    part = _PART.fullmatch(file.name)
    return part[1] + _kind(file) if part else file.name


def _kind(file: Path) -> str:
    """``.db3`` or ``.mcap``, be it packed or not."""
    return (file.with_suffix("") if file.suffix == _PACKED else file).suffix


def _open_file(
    stack: ExitStack, declared: Mapping[str, int], file: Path, schemas: Schemas, loss: PartialLoss
) -> Storage:
    unpacked = _unpack(file, loss.whole, stack) if file.suffix == _PACKED else file
    try:
        if _kind(file) == ".mcap":
            return McapFile(unpacked, schemas, loss)
        return SqliteFile(unpacked, schemas, loss, declared)
    except OpenError as error:
        raise OpenError(str(error).replace(f"{unpacked}: ", f"{file}: ")) from None


def _unpack(file: Path, loss: Loss, stack: ExitStack) -> Path:
    """The unpacked file, in a folder that is deleted when the recording is closed."""
    try:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="ros_visualise_"))
        target = Path(folder, file.stem)
        with open_file(file) as packed, target.open("wb") as unpacked:
            reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
            while block := reader.read(_BLOCK_BYTES):
                check_disk(Path(folder), len(block))
                unpacked.write(block)
    except zstandard.ZstdError:
        loss.add(f"{file.name}: its zstd data is damaged")
    except OpenError as error:
        raise OpenError(f"{file}: once unpacked, it {error}") from None
    except OSError as error:
        raise OpenError(f"{file}: {error.strerror}; make room for the unpacked file") from None
    return target


def _compare(metadata: Metadata, opened: Sequence[tuple[Path, Storage]], loss: Loss) -> None:
    """Compare the messages of the files with the counts of ``metadata.yaml``.

    If a file could not be opened, which is noted, the names of ``opened`` may be shifted.
    """
    topics: Counter[str] = Counter()
    files: Counter[str] = Counter()
    for file, storage in opened:
        files[file.name.removesuffix(_PACKED)] += sum(storage.counts.values())
        for number, count in storage.counts.items():
            if number in storage.channels:
                topics[storage.channels[number].topic] += count
    there = files.total()
    loss.messages = max(loss.messages, (metadata.messages or 0) - there)
    counted = [("", there if metadata.messages is None else metadata.messages, there)]
    counted += [(f" on {name}", n, topics[name]) for name, n in metadata.by_topic.items()]
    by_file = {name.removesuffix(_PACKED): n for name, n in metadata.by_file.items()}
    counted += [(f" in {name}", n, files[name]) for name, n in by_file.items() if name in files]
    for where, count, found in counted:
        if count != found and not loss.notes:  # which say why
            loss.add(f"{METADATA} lists {count} messages{where}; found {found}")


class CompressedMessages:
    """A `Storage` that decompresses the zstd messages of another; ``is_declared``: by the bag."""

    def __init__(self, storage: Storage, loss: Loss, is_declared: bool) -> None:
        self._storage, self._loss, self._is_declared = storage, loss, is_declared
        self._lost: set[tuple[str, int]] = set()
        self.size, self.channels, self.counts = storage.size, storage.channels, storage.counts
        self.starts_ns, self.ends_ns = storage.starts_ns, storage.ends_ns
        self.compressions: Collection[str] = ("zstd",) if is_declared else storage.compressions
        self.select, self.stamps_ns = storage.select, storage.stamps_ns
        self.extras, self.close = storage.extras, storage.close

    def open_piece(self, piece: int, query: MessageQuery, cache: PieceCache) -> Piece:
        return _DecompressedPiece(self._storage.open_piece(piece, query, cache), self._decompress)

    def _decompress(self, entry: Entry) -> bool:
        """Decompress a message if it is compressed; false if that fails."""
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
        elif self._is_declared and (message.data[:1] != _CDR or len(message.data) < _CDR_BYTES):
            self._lose(entry, "messages that are neither zstd data nor CDR")
            return False
        return True

    def _lose(self, entry: Entry, why: str) -> None:
        if (entry.topic, entry.stamp_ns) not in self._lost:
            self._lost.add((entry.topic, entry.stamp_ns))
            self._loss.add(why, 1)


class _DecompressedPiece:
    def __init__(self, piece: Piece, decompress: Callable[[Entry], bool]) -> None:
        self._piece, self._decompress = piece, decompress

    @property
    def stamp_ns(self) -> int | None:
        return self._piece.stamp_ns

    def read(self, before_ns: int) -> Iterator[Entry]:
        return filter(self._decompress, self._piece.read(before_ns))
