"""How far an estimated trajectory is from the true one: ATE and RPE, as the package evo has them.

ATE, the absolute trajectory error, compares poses of the same time; evo calls it APE. RPE, the
relative pose error, compares the motions between pairs of poses, so it shows drift.

Source: J. Sturm et al., A Benchmark for the Evaluation of RGB-D SLAM Systems, IROS 2012, section
IV; M. Grupp, evo, https://github.com/MichaelGrupp/evo.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.geometry import rotations, transforms

Indices = npt.NDArray[np.intp]
Stamps = npt.NDArray[np.int64]

DELTA_UNITS = {"f": "frames", "m": "m", "deg": "deg", "s": "s"}
"""What the poses of a pair are apart: poses, way, turning, time."""


class Delta(NamedTuple):
    """How far the poses of a pair are apart; the unit is one of `DELTA_UNITS`."""

    amount: float
    unit: str


@dataclass(frozen=True)
class PoseErrors:
    """Of each pose or pair: ``translation_m`` and ``rotation_deg`` (N,), not negative."""

    translation_m: Floats
    rotation_deg: Floats


def associate(stamps_ns: Stamps, others_ns: Stamps, most_ns: int) -> tuple[Indices, Indices]:
    """Which poses belong together: to each of the shorter series the nearest of the other.

    Args:
        stamps_ns, others_ns: (N,) and (M,), both in order.
        most_ns: pairs whose stamps are further apart are left out.

    Returns:
        As many indices of the first as of the second, in order.
    """
    if len(others_ns) > len(stamps_ns):
        return _nearest(stamps_ns, others_ns, most_ns)
    of_others, of_stamps = _nearest(others_ns, stamps_ns, most_ns)
    return of_stamps, of_others


def absolute_errors(T_truth: Floats, T_estimate: Floats) -> PoseErrors:
    """Of poses (N, 4, 4) that belong together: the ATE."""
    return _size(transforms.inverse(T_truth) @ T_estimate)


def relative_errors(T_truth: Floats, T_estimate: Floats, begins: Indices) -> PoseErrors:
    """Of the motions from each of these poses to the next of them: the RPE.

    Args:
        T_truth, T_estimate: (N, 4, 4), poses that belong together.
        begins: (P + 1,), as `chain` gives them.

    Returns:
        The errors of P pairs.
    """
    first, last = begins[:-1], begins[1:]
    true = transforms.inverse(T_truth[first]) @ T_truth[last]
    estimated = transforms.inverse(T_estimate[first]) @ T_estimate[last]
    return _size(transforms.inverse(true) @ estimated)


def chain(stamps_ns: Stamps, T: Floats, delta: Delta) -> Indices:
    """Poses of which each is at least ``delta`` beyond the one before; the first is the first."""
    if delta.unit == "f":
        return np.arange(0, len(T), int(delta.amount))
    found, gone = [0], 0.0
    for number, step in enumerate(_steps(stamps_ns, T, delta.unit).tolist(), start=1):
        gone += step
        if gone >= delta.amount:
            found.append(number)
            gone = 0.0
    return np.array(found)


def statistics(errors: Floats) -> dict[str, float]:
    """rmse, mean, median, standard deviation, least, greatest, and the sum of squares."""
    squares = errors**2
    return {
        "rmse": float(np.sqrt(squares.mean())),
        "mean": float(errors.mean()),
        "median": float(np.median(errors)),
        "std": float(errors.std()),
        "min": float(errors.min()),
        "max": float(errors.max()),
        "sse": float(squares.sum()),
    }


def _nearest(few_ns: Stamps, many_ns: Stamps, most_ns: int) -> tuple[Indices, Indices]:
    after = np.searchsorted(many_ns, few_ns, side="right").clip(max=len(many_ns) - 1)
    before = (after - 1).clip(min=0)
    is_before = abs(few_ns - many_ns[before]) <= abs(many_ns[after] - few_ns)
    nearest = np.where(is_before, before, after)
    kept = np.flatnonzero(abs(many_ns[nearest] - few_ns) <= most_ns)
    return kept, nearest[kept]


def _steps(stamps_ns: Stamps, T: Floats, unit: str) -> Floats:
    if unit == "s":
        return np.diff(stamps_ns) / 1e9
    moved = _size(transforms.inverse(T[:-1]) @ T[1:])
    return moved.translation_m if unit == "m" else moved.rotation_deg


def _size(T: Floats) -> PoseErrors:
    """How far motions (N, 4, 4) go and turn."""
    quats = rotations.from_matrix(T[:, :3, :3])
    angles = 2 * np.arctan2(np.linalg.norm(quats[:, :3], axis=1), quats[:, 3])
    return PoseErrors(np.linalg.norm(T[:, :3, 3], axis=1), np.rad2deg(angles))
