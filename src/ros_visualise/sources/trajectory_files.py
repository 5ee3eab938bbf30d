"""Trajectories in text files of the TUM and KITTI benchmarks, which differ in numbers per line.

TUM: ``time x y z qx qy qz qw``, the time in seconds. KITTI: the upper three rows of T_frame_pose,
and no time. Lines that begin with # are comments.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np

from ros_visualise.core.errors import OpenError, TooLarge
from ros_visualise.core.limits import check_numbers
from ros_visualise.core.regular_files import open_file, read_text
from ros_visualise.data import Floats
from ros_visualise.geometry import rotations
from ros_visualise.sources.trajectories import Trajectory, ordered

log = logging.getLogger(__name__)

_TUM, _KITTI = 8, 12
_HEAD_SIZE = 4096
_NEAR = 1e-2  # how far a matrix may be from a rotation: files have few digits
_MOST_S = Decimal(2**63 // 10**9 - 1)


def is_trajectory_file(path: Path) -> bool:
    """True if a file's first line that is no comment has as many numbers as one of a trajectory."""
    try:
        with open_file(path) as file:
            head = file.read(_HEAD_SIZE).decode("utf-8-sig", "replace")
    except OSError:
        return False
    _, numbers = next(_lines(head), (0, []))
    try:
        return len(list(map(float, numbers))) in (_TUM, _KITTI)
    except ValueError:
        return False


def read_trajectory_file(path: Path) -> Trajectory:
    """The trajectory in a file for which `is_trajectory_file`.

    Lines that are no pose are skipped and counted.

    Raises:
        OpenError: it cannot be read, or is too large.
        RosVisualiseError: no line of it is a pose.
    """
    try:
        check_numbers(path.stat().st_size)
        text = read_text(path, "utf-8-sig")
    except (OSError, TooLarge) as error:
        raise OpenError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    lines = list(_lines(text))
    width = len(lines[0][1])
    stamps_ns, rows, wrong = [], [], []
    for number, line in lines:
        try:
            if len(line) != width:
                raise ValueError
            stamp_ns, row = (_tum if width == _TUM else _kitti)(line)
        except (ValueError, InvalidOperation):
            wrong.append(number)
        else:
            stamps_ns.append(stamp_ns)
            rows.append(row)
    if wrong:
        log.warning("%s: line %d is not a pose (further occurrences suppressed)", path, wrong[0])
    left_out = {"damaged": len(wrong)} if wrong else {}
    found = ordered(str(path), np.array(stamps_ns, np.int64), np.array(rows), "", left_out)
    found.stamped = width == _TUM
    found.repeated = found.repeated if found.stamped else 0
    return found


def _lines(text: str) -> Iterator[tuple[int, list[str]]]:
    """(Number, words) of each line that is no comment."""
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if words and not words[0].startswith("#"):
            yield number, words


def _tum(words: list[str]) -> tuple[int, Floats]:
    seconds = Decimal(words[0])
    if not abs(seconds) < _MOST_S:
        raise ValueError("no time")
    return int(seconds.scaleb(9).to_integral_value()), _finite(words[1:])


def _kitti(words: list[str]) -> tuple[int, Floats]:
    upper = _finite(words).reshape(3, 4)
    R = upper[:, :3]
    if abs(R @ R.T - np.eye(3)).max() > _NEAR or np.linalg.det(R) < 0:
        raise ValueError("no rotation")
    return 0, np.concatenate([upper[:, 3], rotations.from_matrix(R)])


def _finite(words: list[str]) -> Floats:
    numbers = np.array(words, np.float64)
    if not np.isfinite(numbers).all():
        raise ValueError("no numbers")
    return numbers
