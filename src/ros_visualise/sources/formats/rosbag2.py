"""ROS 2 bags: folders, single SQLite files, and files of a folder without metadata."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

from ros_visualise.core.regular_files import open_file
from ros_visualise.sources.formats import Format
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.metadata import METADATA

_MAX_METADATA = 4 << 20  # bytes


def _open(path: Path) -> Recording:
    from ros_visualise.sources.recordings.rosbag2 import open_rosbag2

    return open_rosbag2(path.parent if path.is_file() and _is_listed(path) else path)


def _is_listed(path: Path) -> bool:
    """True if the folder's metadata names a file."""
    metadata = path.parent / METADATA
    if not metadata.is_file():
        return False
    with open_file(metadata) as file:
        return os.fsencode(path.name) in file.read(_MAX_METADATA)


def _are_parts(files: Sequence[Path]) -> bool:
    """True if they are named as parts of one bag: ``NAME_0.db3``, ``NAME_1.db3``, ..."""
    names = {re.sub(r"_\d+(?=\.\w+$)", "", file.name) for file in files}
    return len(names) == 1 and {file.suffix for file in files} <= {".db3", ".mcap"}


FORMAT = Format(
    "ROS 2 bag's SQLite file",
    _open,
    suffixes=(".db3",),
    begins=lambda head: head.startswith(b"SQLite format 3\0"),
    is_folder=lambda folder: (folder / METADATA).is_file(),
    is_series=_are_parts,
)
