"""Pose and covariance of one landmark, with the robot's error as a considered state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import se3
from ros_visualise.landmarks.gates import GATES
from ros_visualise.landmarks.localization.seen import Equations, Expect

E = TypeVar("E")
_VAGUE_M2, _VAGUE_RAD2 = 1e8, 1e6
_ROUNDS = 5  # of linearization: directions are not linear in the position
_CONVERGED = 1e-6  # metres, radians


@dataclass(frozen=True)
class LandmarkEstimate:
    """A landmark in the fixed frame.

    ``joint`` (12, 12) is the covariance of its error (x, y, z, rotation vector) and of the robot's
    error, see `ros_visualise.landmarks.localization.robot_error`. ``weight`` (6, 6) is what the
    landmark's covariance would be if each view had an independent robot error. It determines the
    gain of the next view, so that all views of a landmark count equally.
    """

    position_xyz: Floats
    R_fixed_landmark: Floats
    joint: Floats
    weight: Floats

    @property
    def covariance(self) -> Floats:
        """(6, 6) of x, y, z and rotations about these axes, in the fixed frame."""
        covariance: Floats = self.joint[:6, :6]
        return covariance

    def minus(self, other: LandmarkEstimate) -> Floats:
        """(6,) error of another estimate relative to this one."""
        turn = se3.turn_between(self.R_fixed_landmark, other.R_fixed_landmark)
        return np.concatenate([self.position_xyz - other.position_xyz, turn])

    def propagated(self, kept: Floats, covariance: Floats) -> LandmarkEstimate:
        """The same after the robot's error changed: its new covariance, and how much of it was
        kept.
        """
        joint = np.empty((12, 12))
        joint[:6, :6], joint[6:, 6:] = self.joint[:6, :6], covariance
        joint[:6, 6:] = self.joint[:6, 6:] @ kept.T
        joint[6:, :6] = joint[:6, 6:].T
        return replace(self, joint=joint)


@dataclass(frozen=True)
class CandidateUpdate(Generic[E]):
    """An estimate updated by a measurement, and their consistency.

    Attributes:
        updated: the estimate after the measurement; unchanged by an outlier.
        distance2: squared Mahalanobis distance of ``size`` numbers.
        evidence: log-likelihood of the measurement given the estimate, relative to that of the
            noise alone; comparable between measurements of different precision.
    """

    updated: E
    distance2: float
    size: int
    evidence: float

    @property
    def is_inlier(self) -> bool:
        """True if it passes the gate of this landmark."""
        return self.distance2 < GATES[self.size]


def vague(position_xyz: Floats, R_fixed_landmark: Floats, robot: Floats) -> LandmarkEstimate:
    """A landmark with unknown pose; the given one is the starting point.

    Args:
        robot: (6, 6) covariance of the robot's error.
    """
    begun = known(position_xyz, R_fixed_landmark, np.diag([_VAGUE_M2] * 3 + [_VAGUE_RAD2] * 3))
    begun.joint[6:, 6:] = robot
    return begun


def known(position_xyz: Floats, R_fixed_landmark: Floats, covariance: Floats) -> LandmarkEstimate:
    """A landmark whose covariance (6, 6) is independent of the robot's present error."""
    joint = np.zeros((12, 12))
    joint[:6, :6] = covariance
    return LandmarkEstimate(position_xyz, R_fixed_landmark, joint, covariance)


def fit(estimate: LandmarkEstimate, expect: Expect) -> CandidateUpdate[LandmarkEstimate]:
    """Update an estimate by a measurement; the robot's error is considered, not estimated.

    Many views with the same robot error would reveal that error, but the gain ignores this. The
    optimal gain would rely far too much on the error being small and constant.

    Source: Jazwinski, Stochastic Processes and Filtering Theory, 1970, section 8.4, for the
    considered states; Bell and Cathey, The iterated Kalman filter update as a Gauss-Newton method,
    IEEE Trans. Automatic Control 38 (1993), for the rounds.
    """
    first = expect(estimate.position_xyz, estimate.R_fixed_landmark)
    whole = np.hstack([first.H, first.J])
    found = compare(estimate, first, whole @ estimate.joint @ whole.T + first.noise)
    if not found.is_inlier:
        return found
    step, equations, moved = np.zeros(6), first, estimate
    for _ in range(_ROUNDS):
        gain = _gain(equations, estimate)
        before, step = step, gain @ (equations.residual + equations.H @ step)
        moved = _moved(estimate, step)
        if np.abs(step - before).max() < _CONVERGED:
            break
        equations = expect(moved.position_xyz, moved.R_fixed_landmark)
    return replace(found, updated=_after(moved, gain, equations))


def _gain(equations: Equations, estimate: LandmarkEstimate) -> Floats:
    """(6, k) gain as if the robot's error were independent."""
    _, H, J, noise = equations
    spread = H @ estimate.weight @ H.T + J @ estimate.joint[6:, 6:] @ J.T + noise
    gain: Floats = np.linalg.solve(spread, H @ estimate.weight).T
    return gain


def _after(moved: LandmarkEstimate, gain: Floats, equations: Equations) -> LandmarkEstimate:
    """The covariances after an update by any gain (Joseph form)."""
    _, H, J, noise = equations
    keep = np.eye(12)
    keep[:6] -= gain @ np.hstack([H, J])
    joint = keep @ moved.joint @ keep.T
    joint[:6, :6] += gain @ noise @ gain.T
    kept = keep[:6, :6]
    new = noise + J @ moved.joint[6:, 6:] @ J.T
    weight = kept @ moved.weight @ kept.T + gain @ new @ gain.T
    return replace(moved, joint=(joint + joint.T) / 2, weight=(weight + weight.T) / 2)


def compare(estimate: E, equations: Equations, spread: Floats) -> CandidateUpdate[E]:
    """Consistency of a measurement, whose residual has the covariance ``spread`` (k, k)."""
    residual, noise = equations.residual, equations.noise
    distance2 = float(residual @ np.linalg.solve(spread, residual))
    volume = np.linalg.slogdet(noise)[1] - np.linalg.slogdet(spread)[1]
    return CandidateUpdate(estimate, distance2, len(residual), float(volume - distance2) / 2)


def _moved(estimate: LandmarkEstimate, step: Floats) -> LandmarkEstimate:
    R = se3.exp(step)[0] @ estimate.R_fixed_landmark
    return replace(estimate, position_xyz=estimate.position_xyz + step[:3], R_fixed_landmark=R)
