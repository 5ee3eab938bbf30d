"""Which names may be written to."""

from __future__ import annotations

import contextlib
import math
import os
import stat
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from ros_visualise.errors import OpenError, UsageError
from ros_visualise.sources.recordings.metadata import METADATA

_MAX_BYTES = 200  # of a name that a browser gives; file systems take 255
_LEFT_BY_SQLITE = ("-wal", "-journal", "-shm")
"""What comes after a database's name in those of the files that belong to it."""


def parse_target(target: str) -> tuple[Path, tuple[str, ...]]:
    """(File, topics) of OUT[@TOPIC[,TOPIC...]]; no topics where it names none."""
    path, topics = _split(target)
    return Path(path), tuple(dict.fromkeys(name for name in topics.split(",") if name))


def record_folder(path: Path) -> Path:
    """The folder that a page records to.

    Raises:
        OpenError: there is none.
    """
    check_name(path)
    if not os.path.isdir(path):
        raise OpenError(f"{path}: there is no such folder to record to; create it first")
    return path


def in_folder(folder: Path, target: str) -> str:
    """A target in a folder, of which somebody may choose the name, and nothing but the name.

    Raises:
        UsageError: it is no name, or one that hides or leads elsewhere.
    """
    name, topics = _split(target)
    size = len(name.encode(errors="replace"))
    if size > _MAX_BYTES:
        raise UsageError(f"a name of {size} bytes: give one of at most {_MAX_BYTES}")
    check_name(name)
    if not name or name.startswith(".") or "/" in name or "\\" in name:
        raise UsageError(
            f"{name!r}: give a name alone, without folders and without a dot before it"
        )
    return f"{folder / name}@{topics}" if topics else str(folder / name)


def check_name(path: str | Path) -> None:
    """Refuse a name that cannot be shown on a line.

    Raises:
        UsageError: it holds control characters, or bytes that are not UTF-8.
    """
    if any(unicodedata.category(letter) in ("Cc", "Cs") for letter in str(path)):
        raise UsageError(f"{str(path)!r}: holds control characters; choose another name")


def check_targets(targets: Sequence[Path], source: str | Path | None) -> None:
    """Refuse a target that is given twice or is being read, whatever it is called.

    Args:
        targets: what is going to be written.
        source: what is read; there need be no such file, as of a camera.

    Raises:
        UsageError: two are one, one is in the other, or a target holds or is a part of the source.
    """
    for number, target in enumerate(targets):
        check_name(target)
        if any(_meet(target, other) for other in targets[:number]):
            raise UsageError(f"{target}: is in use already; choose another name")
    there = [target for target in targets if os.path.lexists(target)]
    read = _all_of(_files_read(Path(source))) if source and there else set()
    for target in there:
        if read & _all_of([target], depth=1):
            raise UsageError(
                f"{target}: is in use: it is what is read, or a part of it; choose another name"
            )


def _meet(one: Path, other: Path) -> bool:
    paths = [Path(os.path.realpath(path)) for path in (one, other)]
    if any(path in (other, *other.parents) for path, other in (paths, paths[::-1])):
        return True
    return bool(_all_of([one], depth=1) & _all_of([other], depth=1))


def _files_read(source: Path) -> Iterator[Path]:
    """The files and folders of which a source consists."""
    yield source
    beside = Path(os.path.realpath(source))
    yield from (beside.with_name(f"{beside.name}{end}") for end in _LEFT_BY_SQLITE if beside.name)
    folder = source if os.path.isdir(source) else source.parent
    if os.path.isfile(folder / METADATA):  # of a ROS 2 bag all files are read
        yield folder
    if os.path.isdir(source):  # and of KITTI's what is beside the folders
        for place in (folder.absolute(), Path(os.path.realpath(folder))):
            yield from place.parent.glob("calib_*.txt")
            yield place.parent.parent / "poses" / f"{place.name}.txt"


def _all_of(paths: Iterable[Path], depth: float = math.inf) -> set[tuple[int, int]]:
    """What tells files apart however they are named, of these and of all below them."""
    found: set[tuple[int, int]] = set()
    level = list(paths)
    while level and depth >= 0:
        below: list[Path] = []
        for path in level:
            with contextlib.suppress(OSError, ValueError):
                about = path.stat()
                identity = about.st_dev, about.st_ino
                if identity not in found and stat.S_ISDIR(about.st_mode):
                    below += path.iterdir()
                found.add(identity)
        level, depth = below, depth - 1
    return found


def _split(target: str) -> tuple[str, str]:
    path, _, topics = target.rpartition("@")
    return (path, topics) if path and topics.startswith("/") else (target, "")
