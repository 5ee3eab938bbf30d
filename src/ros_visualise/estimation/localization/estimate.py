"""Pose, velocity and covariance of one landmark, with the robot's error as a considered state."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.gates import Innovation
from ros_visualise.estimation.localization.seen import Equations, Expect
from ros_visualise.geometry import se3

POSE = slice(0, 6)
OWN, ROBOT = slice(0, 9), slice(9, 15)
"""Errors of a landmark: x, y, z, rotation vector, velocity; then those of the robot."""

_VAGUE_M2, _VAGUE_RAD2 = 1e8, 1e6
_ROUNDS = 5  # of linearization: directions are not linear in the position
_CONVERGED = 1e-6  # metres, radians


@dataclass(frozen=True)
class LandmarkEstimate:
    """A landmark in the fixed frame.

    ``joint`` (15, 15) is the covariance of its errors and of the robot's, see
    `ros_visualise.estimation.localization.robot_error`. ``weight`` (9, 9) is what the landmark's
    covariance would be if each view had an independent robot error. It determines the gain of the
    next view, so that all views of a landmark count equally.
    """

    position_xyz: Floats
    R_fixed_landmark: Floats
    joint: Floats
    weight: Floats
    velocity_xyz: Floats = field(default_factory=lambda: np.zeros(3))

    @property
    def covariance(self) -> Floats:
        """(9, 9) of x, y, z, rotations about these axes, and velocity, in the fixed frame."""
        covariance: Floats = self.joint[OWN, OWN]
        return covariance

    def minus(self, other: LandmarkEstimate) -> Floats:
        """(9,) error of another estimate relative to this one."""
        turn = se3.turn_between(self.R_fixed_landmark, other.R_fixed_landmark)
        off = self.position_xyz - other.position_xyz, self.velocity_xyz - other.velocity_xyz
        return np.concatenate([off[0], turn, off[1]])

    def propagated(self, kept: Floats, covariance: Floats) -> LandmarkEstimate:
        """The same after the robot's error changed: its new covariance, and how much of it was
        kept.
        """
        joint = self.joint.copy()
        joint[ROBOT, ROBOT] = covariance
        joint[OWN, ROBOT] = self.joint[OWN, ROBOT] @ kept.T
        joint[ROBOT, OWN] = joint[OWN, ROBOT].T
        return replace(self, joint=joint)

    def inflated(self, covariance: Floats) -> LandmarkEstimate:
        """The same with one more error (6, 6) of its pose, which is common to all views of it."""
        joint, weight = self.joint.copy(), self.weight.copy()
        joint[POSE, POSE] += covariance
        weight[POSE, POSE] += covariance
        return replace(self, joint=joint, weight=weight)

    def moved(self, step: Floats) -> LandmarkEstimate:
        """The same, corrected by errors (9,)."""
        R = se3.exp(step[POSE])[0] @ self.R_fixed_landmark
        p, v = self.position_xyz + step[:3], self.velocity_xyz + step[6:]
        return replace(self, position_xyz=p, R_fixed_landmark=R, velocity_xyz=v)


class CandidateUpdate(NamedTuple):
    """An estimate updated by a measurement, unchanged by an outlier; and their consistency."""

    updated: LandmarkEstimate
    fit: Innovation


def vague(position_xyz: Floats, R_fixed_landmark: Floats, robot: Floats) -> LandmarkEstimate:
    """A landmark with unknown pose; the given one is the starting point.

    Args:
        robot: (6, 6) covariance of the robot's error.
    """
    begun = known(position_xyz, R_fixed_landmark, np.diag([_VAGUE_M2] * 3 + [_VAGUE_RAD2] * 3))
    begun.joint[ROBOT, ROBOT] = robot
    return begun


def known(position_xyz: Floats, R_fixed_landmark: Floats, covariance: Floats) -> LandmarkEstimate:
    """A landmark whose covariance is independent of the robot's present error.

    Args:
        covariance: (6, 6) of a landmark that stands still, or (9, 9).
    """
    joint = np.zeros((ROBOT.stop, ROBOT.stop))
    joint[: len(covariance), : len(covariance)] = covariance
    return LandmarkEstimate(position_xyz, R_fixed_landmark, joint, joint[OWN, OWN].copy())


def fit(estimate: LandmarkEstimate, expect: Expect) -> CandidateUpdate:
    """Update an estimate by a measurement; the robot's error is considered, not estimated.

    Many views with the same robot error would reveal that error, but the gain ignores this. The
    optimal gain would rely far too much on the error being small and constant.

    Source: Jazwinski, Stochastic Processes and Filtering Theory, 1970, section 8.4, for the
    considered states; Bell and Cathey, The iterated Kalman filter update as a Gauss-Newton method,
    IEEE Trans. Automatic Control 38 (1993), for the rounds.
    """
    first = expect(estimate.position_xyz, estimate.R_fixed_landmark)
    whole = np.hstack([_by_own(first), first.J])
    spread = whole @ estimate.joint @ whole.T + first.noise
    found = Innovation.of(first.residual, spread, first.noise)
    if not found.is_inlier:
        return CandidateUpdate(estimate, found)
    step, equations, moved = np.zeros(OWN.stop), first, estimate
    for _ in range(_ROUNDS):
        gain = _gain(equations, estimate)
        before, step = step, gain @ (equations.residual + equations.H @ step[POSE])
        moved = estimate.moved(step)
        if np.abs(step - before).max() < _CONVERGED:
            break
        equations = expect(moved.position_xyz, moved.R_fixed_landmark)
    return CandidateUpdate(_after(moved, gain, equations), found)


def _by_own(equations: Equations) -> Floats:
    """(k, 9) derivative by the landmark's errors."""
    return np.hstack([equations.H, np.zeros((len(equations.H), OWN.stop - POSE.stop))])


def _gain(equations: Equations, estimate: LandmarkEstimate) -> Floats:
    """(9, k) gain as if the robot's error were independent."""
    H, J = _by_own(equations), equations.J
    spread = H @ estimate.weight @ H.T + J @ estimate.joint[ROBOT, ROBOT] @ J.T + equations.noise
    gain: Floats = np.linalg.solve(spread, H @ estimate.weight).T
    return gain


def _after(moved: LandmarkEstimate, gain: Floats, equations: Equations) -> LandmarkEstimate:
    """The covariances after an update by any gain (Joseph form)."""
    J, noise = equations.J, equations.noise
    keep = np.eye(ROBOT.stop)
    keep[OWN] -= gain @ np.hstack([_by_own(equations), J])
    joint = keep @ moved.joint @ keep.T
    joint[OWN, OWN] += gain @ noise @ gain.T
    kept, new = keep[OWN, OWN], noise + J @ moved.joint[ROBOT, ROBOT] @ J.T
    weight = kept @ moved.weight @ kept.T + gain @ new @ gain.T
    return replace(moved, joint=(joint + joint.T) / 2, weight=(weight + weight.T) / 2)
