"""A trajectory aligned with the truth, and its errors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ros_visualise.core.errors import UsageError, did_you_mean
from ros_visualise.data import Floats, Path
from ros_visualise.geometry import se3
from ros_visualise.geometry.similarity import Similarity
from ros_visualise.geometry.trajectory_errors import (
    ALIGNMENTS,
    NEXT,
    Delta,
    Indices,
    PoseErrors,
    Stamps,
    absolute_errors,
    align,
    associate,
    chain,
    relative_errors,
    step_errors,
)
from ros_visualise.sources.trajectories import Trajectory

_NS = 1_000_000_000
_IDENTITY = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Comparison:
    """One trajectory and the truth.

    Attributes:
        trajectory: the whole trajectory, aligned.
        alignment: the transform that aligned it.
        align, delta: how it was aligned, and which poses were paired.
        moments: stamps (N,), or numbers, of the compared poses.
        apart_s: largest difference of the stamps of two compared poses.
        ate: errors of each compared pose.
        rpe: errors of each pair of them; None if no two are so far apart. Without attitudes: of the
            lengths of the steps.
        without_attitude: topics or files of the trajectories that have no attitudes, or state that
            nothing turned, as an unknown attitude is written; if there are any, only the errors in
            metres are valid.
    """

    trajectory: Trajectory
    alignment: Similarity
    align: str
    delta: Delta
    moments: Stamps
    apart_s: float
    ate: PoseErrors
    rpe: PoseErrors | None
    without_attitude: tuple[str, ...]

    @property
    def turns(self) -> bool:
        """True if both have attitudes."""
        return not self.without_attitude


def compare(
    found: Trajectory,
    truth: Trajectory,
    how: str = "none",
    delta: Delta = NEXT,
    max_difference_s: float = 0.01,
) -> Comparison:
    """Compare with the truth.

    Args:
        found, truth: both in order of their stamps.
        how: one of `ros_visualise.geometry.trajectory_errors.ALIGNMENTS`.
        delta: distance between the poses whose motion is compared.
        max_difference_s: of the stamps of two compared poses.

    Raises:
        UsageError: no matching poses, or they cannot be aligned like that.
    """
    _check_alignment(found, truth, how)
    is_flat = _lack_attitudes(found, truth)
    flat = tuple(one.topic for one, lacks in zip((found, truth), is_flat, strict=True) if lacks)
    of_truth, of_found = _pairs(found, truth, round(max_difference_s * _NS))
    T_truth, T = _poses(truth.path)[of_truth], _poses(found.path)
    try:
        alignment = align(T_truth, T[of_found], how)
    except ValueError as error:
        other = "none" if flat else "origin"
        why = f"cannot align by {how}: {error}; use {other}"
        raise UsageError(f"{found.topic}: {why}") from None
    T = alignment.apply(T)
    stamps_ns = found.path.stamps_ns[of_found]
    begins = chain(stamps_ns, T[of_found], delta)
    relative = step_errors if flat else relative_errors
    apart_ns = abs(stamps_ns - truth.path.stamps_ns[of_truth]).max() if found.stamped else 0
    return Comparison(
        _moved(found, T, not is_flat[0]) if how != "none" else found,
        alignment,
        how,
        delta,
        (stamps_ns if found.stamped and truth.stamped else of_found).astype(np.int64),
        float(apart_ns) / _NS,
        absolute_errors(T_truth, T[of_found]),
        relative(T_truth, T[of_found], begins) if len(begins) > 1 else None,
        flat,
    )


def _lack_attitudes(*both: Trajectory) -> list[bool]:
    """Tell which have no attitudes: by their type, or identity rotations all along.

    Programs write an unknown attitude as 0 0 0 1. If neither turns, both are taken as stated.
    """
    is_flat = [not one.turns for one in both]
    if not any(is_flat):
        is_flat = [bool((one.path.quats_xyzw == _IDENTITY).all()) for one in both]
    return is_flat if not all(is_flat) else [not one.turns for one in both]


def _check_alignment(found: Trajectory, truth: Trajectory, how: str) -> None:
    if how not in ALIGNMENTS:
        raise UsageError(f"no alignment {how!r}{did_you_mean(how, ALIGNMENTS)}")
    flat = [one.topic for one in (found, truth) if not one.turns]
    if how == "origin" and flat:
        raise UsageError(f"{flat[0]} has no attitudes, which align=origin needs; use align=se3")


def _pairs(found: Trajectory, truth: Trajectory, most_ns: int) -> tuple[Indices, Indices]:
    """Indices of matching poses in the truth and in the other."""
    if found.stamped and truth.stamped:
        pairs = associate(truth.path.stamps_ns, found.path.stamps_ns, most_ns)
        if not len(pairs[0]):
            raise UsageError(_why_none(found, truth, most_ns))
        return pairs
    count, other = len(found.path.stamps_ns), len(truth.path.stamps_ns)
    if count != other:
        without = truth if found.stamped else found
        raise UsageError(
            f"{without.topic} has no times, so poses would be matched by index, but {found.topic} "
            f"has {count} poses and {truth.topic} has {other}; give both with times (TUM)"
        )
    return np.arange(count), np.arange(count)


def _why_none(found: Trajectory, truth: Trajectory, most_ns: int) -> str:
    spans = (
        f"{one.topic} goes from {one.path.stamps_ns[0] / _NS:.3f} to"
        f" {one.path.stamps_ns[-1] / _NS:.3f} s"
        for one in (found, truth)
    )
    return (
        f"no poses within {most_ns / _NS:g} s of each other: {', '.join(spans)};"
        " allow a larger maximum difference"
    )


def _poses(path: Path) -> Floats:
    return se3.from_pose(path.positions_xyz, path.quats_xyzw)


def _moved(found: Trajectory, T: Floats, turns: bool) -> Trajectory:
    path: Any = found.path
    positions_xyz, quats_xyzw = se3.to_pose(T)
    quats_xyzw = quats_xyzw if turns else path.quats_xyzw
    return replace(found, path=replace(path, positions_xyz=positions_xyz, quats_xyzw=quats_xyzw))
