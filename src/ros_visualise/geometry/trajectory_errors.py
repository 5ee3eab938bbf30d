"""Errors of estimated poses and trajectories: ATE and RPE, as in the package evo, and NEES.

ATE, the absolute trajectory error, compares poses of the same time; evo calls it APE. RPE, the
relative pose error, compares the motions between pairs of poses, so it shows drift.

Source: J. Sturm et al., A Benchmark for the Evaluation of RGB-D SLAM Systems, IROS 2012, section
IV; M. Grupp, evo, https://github.com/MichaelGrupp/evo.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Floats
from ros_visualise.geometry import rotations, se3
from ros_visualise.geometry.similarity import Similarity

Indices = npt.NDArray[np.intp]
Stamps = npt.NDArray[np.int64]

DELTA_UNITS = {"f": "frames", "m": "m", "deg": "deg", "s": "s"}
"""Units of the distance between the poses of a pair: number of poses, length, angle, time."""


class Delta(NamedTuple):
    """Distance between the poses of a pair; the unit is one of `DELTA_UNITS`."""

    amount: float
    unit: str

    def __str__(self) -> str:
        return f"{self.amount:g}{self.unit}"

    @property
    def words(self) -> str:
        """The distance in words, as ``1 frame`` or ``10 m``."""
        name = DELTA_UNITS[self.unit]
        return f"{self.amount:g} {'frame' if self.amount == 1 and self.unit == 'f' else name}"


NEXT = Delta(1, "f")
"""From each pose to the next."""


def parse_delta(text: str) -> Delta:
    """The distance that a text such as ``10m`` gives; raises UsageError."""
    found = re.fullmatch(r"(\d{1,9}(?:\.\d{1,9})?)(f|m|deg|s)", text)
    amount = float(found[1]) if found else 0.0
    if found is None or amount <= 0 or (found[2] == "f" and not amount.is_integer()):
        raise UsageError(
            f"delta {text!r}: give a number of poses (1f), a distance (10m), an angle"
            " (5deg) or a time (1s)"
        )
    return Delta(amount, found[2])


@dataclass(frozen=True)
class PoseErrors:
    """Errors of each pose or pair: ``translation_m`` and ``rotation_deg`` (N,), not negative.

    NaN if unknown.
    """

    translation_m: Floats
    rotation_deg: Floats


def associate(stamps_ns: Stamps, others_ns: Stamps, most_ns: int) -> tuple[Indices, Indices]:
    """Pairs of poses: for each of the shorter series the nearest one of the other.

    Args:
        stamps_ns, others_ns: (N,) and (M,), both in order.
        most_ns: maximum difference of their stamps.

    Returns:
        As many indices of the first as of the second, in order.
    """
    if len(others_ns) > len(stamps_ns):
        return _nearest(stamps_ns, others_ns, most_ns)
    of_others, of_stamps = _nearest(others_ns, stamps_ns, most_ns)
    return of_stamps, of_others


def absolute_errors(T_truth: Floats, T_estimate: Floats) -> PoseErrors:
    """The ATE of pairs of poses (N, 4, 4)."""
    return _size(se3.inverse(T_truth) @ T_estimate)


def relative_errors(T_truth: Floats, T_estimate: Floats, begins: Indices) -> PoseErrors:
    """The RPE: errors of the motions from each of these poses to the next one.

    Args:
        T_truth, T_estimate: (N, 4, 4), pairs of poses.
        begins: (P + 1,) indices; see `chain`.

    Returns:
        The errors of P pairs.
    """
    first, last = begins[:-1], begins[1:]
    true = se3.inverse(T_truth[first]) @ T_truth[last]
    estimated = se3.inverse(T_estimate[first]) @ T_estimate[last]
    return _size(se3.inverse(true) @ estimated)


def step_errors(T_truth: Floats, T_estimate: Floats, begins: Indices) -> PoseErrors:
    """The RPE of poses without attitudes: errors of the distances between the positions of pairs.

    Evo calls it point distance. Arguments as of `relative_errors`; the rotations are unknown.
    """
    true, estimated = (
        np.linalg.norm(np.diff(T[begins, :3, 3], axis=0), axis=1) for T in (T_truth, T_estimate)
    )
    return PoseErrors(abs(estimated - true), np.full(len(true), np.nan))


def chain(stamps_ns: Stamps, T: Floats, delta: Delta) -> Indices:
    """Indices of poses, each at least ``delta`` beyond the one before, beginning with the first."""
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
    moved = _size(se3.inverse(T[:-1]) @ T[1:])
    return moved.translation_m if unit == "m" else moved.rotation_deg


def _size(T: Floats) -> PoseErrors:
    """Lengths and angles of motions (N, 4, 4)."""
    quats = rotations.from_matrix(T[:, :3, :3])
    angles = 2 * np.arctan2(np.linalg.norm(quats[:, :3], axis=1), quats[:, 3])
    return PoseErrors(np.linalg.norm(T[:, :3, 3], axis=1), np.rad2deg(angles))


ALIGNMENTS = ("none", "origin", "se3", "sim3")
"""Methods: not at all; by the first poses; by all positions; by all positions, with a scale."""

_FLAT = 1e-14  # of the largest singular value: below it, positions lie on a line


def align(T_truth: Floats, T_estimate: Floats, how: str) -> Similarity:
    """The motion, and scale, that aligns an estimate with the truth.

    Args:
        T_truth, T_estimate: (N, 4, 4), pairs of poses.
        how: one of `ALIGNMENTS`.

    Raises:
        ValueError: the positions lie on a line, so the rotation about it is unknown.
    """
    if how == "none":
        return Similarity(1.0, np.eye(3), np.zeros(3))
    if how == "origin":
        T = T_truth[0] @ se3.inverse(T_estimate[0])
        return Similarity(1.0, T[:3, :3], T[:3, 3])
    return fit_similarity(T_estimate[:, :3, 3], T_truth[:, :3, 3], with_scale=how == "sim3")


def fit_similarity(points_xyz: Floats, targets_xyz: Floats, with_scale: bool) -> Similarity:
    """The motion, and scale, that takes points (N, 3) nearest to their targets (N, 3).

    Raises:
        ValueError: the points lie on a line, so the rotation about it is unknown.

    Source: S. Umeyama, Least-squares estimation of transformation parameters between two point
    patterns, IEEE PAMI 13 (1991), equations 38 to 43.
    """
    center, target = points_xyz.mean(axis=0), targets_xyz.mean(axis=0)
    spread = points_xyz - center
    covariance = (targets_xyz - target).T @ spread / len(points_xyz)
    U, singular, Vt = np.linalg.svd(covariance)
    if singular[1] <= _FLAT * singular[0]:
        raise ValueError("the positions lie on a line, so the rotation about that line is unknown")
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    rotation = (U * signs) @ Vt
    variance = (spread**2).sum() / len(points_xyz)
    scale = float(singular @ signs / variance) if with_scale else 1.0
    return Similarity(scale, rotation, target - scale * rotation @ center)


NEES_BAND = (1.2373, 14.4494)
"""95% of the NEES of consistent poses: quantiles of chi-square with 6 degrees of freedom."""

_SMALL = 1e-9  # of a quaternion's sine: below it, the rotation vector is twice its imaginary part


def pose_error(
    position_xyz: Floats, quat_xyzw: Floats, true_xyz: Floats, true_xyzw: Floats
) -> Floats:
    """Error of a pose (6,), in the order of ROS's covariances.

    Metres along the frame's x, y and z, and radians about them: the vector of the rotation that
    leads from the true attitude to the estimated one.
    """
    turn = rotations.multiply(quat_xyzw, rotations.inverse(true_xyzw))
    turn = rotations.normalise(turn * (1 if turn[3] >= 0 else -1))
    sine = float(np.linalg.norm(turn[:3]))
    angle_by_sine = 2 * np.arctan2(sine, turn[3]) / sine if sine > _SMALL else 2.0
    return np.concatenate([position_xyz - true_xyz, turn[:3] * angle_by_sine])


def nees(error: Floats, covariance: Floats) -> float | None:
    """The normalised estimation error squared; None if the covariance (6, 6) is singular.

    It is 6 on average for consistent poses, and within `NEES_BAND` for 95% of them; above that the
    covariance is too small, below too large.

    Source: Y. Bar-Shalom et al., Estimation with Applications to Tracking and Navigation (2001),
    section 5.4.2.
    """
    try:
        squared = float(error @ np.linalg.solve(covariance, error))
    except np.linalg.LinAlgError:
        return None
    return squared if np.isfinite(squared) and squared >= 0 else None
