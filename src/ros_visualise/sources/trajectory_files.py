"""Trajectories in text files of the TUM, KITTI and EuRoC benchmarks.

TUM: ``time x y z qx qy qz qw``, the time in seconds. KITTI: the upper three rows of T_frame_pose,
and no time. EuRoC: ``time,x,y,z,qw,qx,qy,qz`` and whatever follows (velocity and biases in
state_groundtruth_estimate0/data.csv), the time in nanoseconds, or with a decimal point in seconds.
Lines that begin with # are comments.
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
_EUROC = 8  # or more
_HEAD_SIZE = 4096
_NEAR = 1e-2  # how far a matrix may be from a rotation: files have few digits
_MOST_S = Decimal(2**63 // 10**9 - 1)
_LATEST_S = Decimal(10**12)  # larger times with a decimal point are nanoseconds too


def is_trajectory_file(path: Path) -> bool:
    """True if a file's first line that is no comment is a pose, or has as many numbers as one."""
    try:
        with open_file(path) as file:
            head = file.read(_HEAD_SIZE).decode("utf-8-sig", "replace")
    except OSError:
        return False
    _, words, is_csv = next(_lines(head), (0, [], False))
    try:
        if is_csv:
            return len(words) >= _EUROC and bool(_euroc(words))
        return len(list(map(float, words))) in (_TUM, _KITTI)
    except (ValueError, InvalidOperation):
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
    _, first, is_csv = lines[0]
    parse = _euroc if is_csv else _tum if len(first) == _TUM else _kitti
    stamps_ns, rows, wrong = [], [], []
    for number, words, _ in lines:
        try:
            if len(words) != len(first):
                raise ValueError
            stamp_ns, row = parse(words)
        except (ValueError, InvalidOperation):
            wrong.append(number)
        else:
            stamps_ns.append(stamp_ns)
            rows.append(row)
    if wrong:
        log.warning("%s: line %d is not a pose (further occurrences suppressed)", path, wrong[0])
    skipped = {"damaged": len(wrong)} if wrong else {}
    found = ordered(str(path), np.array(stamps_ns, np.int64), np.array(rows), "", skipped)
    found.stamped = parse is not _kitti
    found.repeated = found.repeated if found.stamped else 0
    return found


def _lines(text: str) -> Iterator[tuple[int, list[str], bool]]:
    """Number, words, and True if commas separate them, of each line that is no comment."""
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.replace(",", " ").split()
        if words and not words[0].startswith("#"):
            yield number, words, "," in line


def _tum(words: list[str]) -> tuple[int, Floats]:
    seconds = Decimal(words[0])
    if not abs(seconds) < _MOST_S:
        raise ValueError("invalid time")
    return int(seconds.scaleb(9).to_integral_value()), _finite(words[1:])


def _euroc(words: list[str]) -> tuple[int, Floats]:
    time, row = Decimal(words[0]), _finite(words[1:_EUROC])[[0, 1, 2, 4, 5, 6, 3]]
    is_seconds = "." in words[0] and time < _LATEST_S
    stamp_ns = int((time.scaleb(9) if is_seconds else time).to_integral_value())
    if not abs(stamp_ns) < 2**63 or abs(np.linalg.norm(row[3:]) - 1) > _NEAR:
        raise ValueError("invalid time or rotation")
    return stamp_ns, row


def _kitti(words: list[str]) -> tuple[int, Floats]:
    upper = _finite(words).reshape(3, 4)
    R = upper[:, :3]
    if abs(R @ R.T - np.eye(3)).max() > _NEAR or np.linalg.det(R) < 0:
        raise ValueError("invalid rotation")
    return 0, np.concatenate([upper[:, 3], rotations.from_matrix(R)])


def _finite(words: list[str]) -> Floats:
    numbers = np.array(words, np.float64)
    if not np.isfinite(numbers).all():
        raise ValueError("a value is not finite")
    return numbers
