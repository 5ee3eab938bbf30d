"""A format of recordings: trajectories as the TUM RGB-D benchmark writes them.

Each line is ``stamp x y z qx qy qz qw``, in seconds and metres; # begins a comment.
"""

import re
from pathlib import Path

import numpy as np

from ros_visualise.core.errors import OpenError
from ros_visualise.data import Header, PoseStamped
from ros_visualise.sources.formats import Format
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.sources.series import Series

_LINE = re.compile(rb"(\s*#[^\n]*\n)*\s*-?[\d.]+( -?[\d.]+(e-?\d+)?){7}\s", re.I)


def open_tum(path: Path) -> SeriesRecording:
    """Open a trajectory: ``/pose``, in the frame ``map``.

    Raises:
        OpenError: a line does not hold eight numbers.
    """
    try:
        table = np.loadtxt(path, ndmin=2)
    except ValueError as error:
        raise OpenError(f"{path}: {error}; give eight numbers in each line") from None
    stamps_ns = np.round(table[:, 0] * 1e9).astype(np.int64)

    def pose(index: int) -> PoseStamped:
        header = Header(int(stamps_ns[index]), "map")
        return PoseStamped(table[index, 1:4], table[index, 4:8], header)

    series = [Series("/pose", PoseStamped, stamps_ns, pose)]
    return SeriesRecording(path, "TUM trajectory", path.stat().st_size, series)


FORMAT = Format(
    "TUM trajectory",
    open_tum,
    suffixes=(".tum",),
    begins=lambda head: _LINE.match(head) is not None,
)
