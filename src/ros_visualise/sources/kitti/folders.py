"""Finding KITTI's folders from any path at or above them."""

from __future__ import annotations

import os
import re
from pathlib import Path

from ros_visualise.core.errors import OpenError

CAMERAS = range(4)
"""0 and 1 are gray, 2 and 3 in colour; 0 and 2 left, 1 and 3 right."""

PARTS = {"oxts", "velodyne_points", *(f"image_{camera:02d}" for camera in CAMERAS)}
"""The folders of a raw drive's sensors."""

_PART_DEPTH = 2  # of image_02/data in a drive
_DEPTH = 3  # of the folder above a benchmark: dataset/sequences/00
_MOST_FOLDERS = 2000  # looked into, where somebody gives their home folder
_SEQUENCE_PARTS = {"velodyne", *(f"image_{camera}" for camera in CAMERAS)}
_LISTED = 5


def find_folder(path: Path) -> Path:
    """The drive or the benchmark's sequence in ``path``, which may be that folder itself.

    Raises:
        OpenError: there is none, or more than one.
    """
    found = _find(path)
    if not found:
        raise OpenError(
            f"{path}: no KITTI drive in it; give a folder that holds oxts, velodyne_points or"
            " image_00, or a sequence of the odometry benchmark"
        )
    if len(found) > 1:
        names = ", ".join(str(one.relative_to(path)) for one in found[:_LISTED])
        more = f" and {len(found) - _LISTED} more" if len(found) > _LISTED else ""
        raise OpenError(f"{path}: holds {names}{more}; choose, for instance {found[0]}")
    return found[0]


def has_folder(path: Path) -> bool:
    """Whether there is a drive or a sequence in it."""
    return bool(_find(path))


def find_whole(part: Path) -> Path | None:
    """The drive or the sequence of which a folder is a part, if it is one."""
    above = part.absolute().parents[:_PART_DEPTH]
    return next((folder for folder in above if _is_drive(folder) or is_sequence(folder)), None)


def is_sequence(folder: Path) -> bool:
    """Whether it is a sequence of the odometry benchmark."""
    names = _names(folder)
    if not names & {"times.txt", "calib.txt"}:
        return False
    return bool(names & _SEQUENCE_PARTS) or poses_file(folder).is_file()


def poses_file(sequence: Path) -> Path:
    """Where the benchmark keeps a sequence's ground truth: ``poses/04.txt``."""
    sequence = sequence.absolute()
    return sequence.parents[1] / "poses" / f"{sequence.name}.txt"


def is_unsynced(drive: Path) -> bool | None:
    """Whether a drive's name says that it is neither synchronised nor rectified; None: nothing."""
    found = re.search(r"_(sync|extract)\b", drive.absolute().name)
    return None if found is None else found[1] == "extract"


def _is_drive(folder: Path) -> bool:
    """Whether it holds a sensor's folder as the raw drives have it: with its ``data`` below."""
    return any((folder / name / "data").is_dir() for name in _names(folder) & PARTS)


def _find(path: Path) -> list[Path]:
    level, looked_into = [path], 0
    found: list[Path] = []
    for _ in range(_DEPTH + 1):
        below: list[Path] = []
        for folder in level:
            looked_into += 1
            if looked_into > _MOST_FOLDERS:
                return found
            if _is_drive(folder) or is_sequence(folder):
                found.append(folder)
            else:
                below += _folders(folder)
        level = below
    return found


def _folders(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as items:
            names = [i.name for i in items if i.is_dir() and not i.name.startswith(".")]
    except OSError:
        return []
    return [folder / name for name in sorted(names)]


def _names(folder: Path) -> set[str]:
    try:
        return set(os.listdir(folder))
    except OSError:
        return set()
