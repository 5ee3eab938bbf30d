"""Names of targets on the command line."""

from __future__ import annotations

import contextlib
import math
import os
import stat
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.core.paths import check_printable
from ros_visualise.sources.recordings.metadata import METADATA

_LEFT_BY_SQLITE = ("-wal", "-journal", "-shm")
"""Suffixes of the files that belong to a database."""


def parse_target(target: str) -> tuple[Path, tuple[str, ...]]:
    """File and topics of the command line's OUT[@TOPIC[,TOPIC...]]; it may name no topics."""
    path, _, topics = target.rpartition("@")
    if not (path and topics.startswith("/")):
        path, topics = target, ""
    return Path(path), tuple(dict.fromkeys(name for name in topics.split(",") if name))


def record_folder(path: Path) -> Path:
    """The folder that a page records to.

    Raises:
        OpenError: no such folder.
    """
    check_printable(path)
    if not os.path.isdir(path):
        raise OpenError(f"{path}: no such folder for recordings; create it first")
    return path


def check_targets(targets: Sequence[Path], *sources: str | Path | None) -> None:
    """Reject targets that coincide with each other or with a source, under whatever names.

    Args:
        targets: files and folders to write.
        sources: what is read; not a file for a camera.

    Raises:
        UsageError: two coincide, one contains the other, or a target contains or is a part of a
            source.
    """
    for number, target in enumerate(targets):
        check_printable(target)
        if any(_meet(target, other) for other in targets[:number]):
            raise UsageError(f"{target}: already in use; choose another name")
    there = [target for target in targets if os.path.lexists(target)]
    read = {
        one for source in sources if source and there for one in _all_of(_files_read(Path(source)))
    }
    for target in there:
        if read & _all_of([target], depth=1):
            raise UsageError(
                f"{target}: in use as the source, or a part of it; choose another name"
            )


def check_suffix(option: str, path: Path | None, suffixes: Collection[str]) -> None:
    """Reject a file, if one is given, whose name ends in none of these; raises UsageError."""
    if path is not None and path.suffix.lower() not in suffixes:
        raise UsageError(f"{option} {path}: give a name that ends in {' or '.join(suffixes)}")


def _meet(one: Path, other: Path) -> bool:
    paths = [Path(os.path.realpath(path)) for path in (one, other)]
    if any(path in (other, *other.parents) for path, other in (paths, paths[::-1])):
        return True
    return bool(_all_of([one], depth=1) & _all_of([other], depth=1))


def _files_read(source: Path) -> Iterator[Path]:
    """The files and folders of a source."""
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
    """Device and inode of these files, and of all in these folders."""
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
