"""Tracking of a landing target: a Kalman filter of its pose and velocity.

All quantities are in a fixed frame, such as ``odom``. The error state has nine numbers, along its
axes: position in metres, orientation as a rotation vector, velocity in m/s. The target moves at
constant velocity, disturbed by white acceleration noise; its rotation is a random walk, and so is
the drift of the fixed frame. Sightings that contradict the estimate begin another one, see
`ros_visualise.estimation.localization.branches`; they cost the former in proportion to time.

An error of the camera's attitude is common to images that follow one another, so it is considered
as in `ros_visualise.estimation.localization.robot_error`. Where images show that it is larger than
stated, see `ros_visualise.estimation.steadiness`, more is assumed.

Source: Bar-Shalom, Li and Kirubarajan, Estimation with applications to tracking and navigation,
2001, sections 6.2 (the noise) and 5.4 (the gate).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.localization import branches
from ros_visualise.estimation.localization.branches import LOSS, MOVED, Branch, Branches
from ros_visualise.estimation.localization.estimate import (
    OWN,
    ROBOT,
    LandmarkEstimate,
    fit,
    known,
)
from ros_visualise.estimation.localization.robot_error import ErrorModel, RobotError
from ros_visualise.estimation.localization.seen import Ground, PoseReading, robot_error_at
from ros_visualise.estimation.steadiness import Steadiness

_VAGUE_TURN = np.diag((0.1**2, 0.1**2, math.pi**2))  # rad^2, unknown orientation
_TURNS = 0.1  # rad/sqrt(s), of a target that moves
_DRIFTS = 0.01  # rad/sqrt(s), of the fixed frame
_VAGUE_M2 = 1e4
_STEP = 0.5  # of the camera's steadiness
STEADY = ErrorModel(position_m=0.0, attitude_rad=0.0)
"""Error of a camera whose attitude tf knows exactly."""


@dataclass(frozen=True)
class TargetMotion:
    """Motion model of a target.

    Attributes:
        speed: standard deviation of its initial velocity, m/s; 0: it stands still.
        acceleration: standard deviation of its velocity change in one second, m/s.
        tilt: standard deviation of its tilt, radians: of two readings of an image, the more level
            one is likelier.
        drift: of the fixed frame, standard deviation in one second, metres.
        patience_s: how long sightings may contradict the estimate before they replace it; less if
            it was seen a few times only.
    """

    speed: float = 1.0
    acceleration: float = 0.5
    tilt: float = math.radians(10)
    drift: float = 0.01
    patience_s: float = 0.5


def after(target: LandmarkEstimate, elapsed_s: float, motion: TargetMotion) -> LandmarkEstimate:
    """The prediction for a later or earlier time, with larger covariance."""
    F, since_s = np.eye(OWN.stop), abs(elapsed_s)
    F[:3, 6:] = elapsed_s * np.eye(3)
    q = motion.acceleration**2 if motion.speed else 0.0
    noise = np.zeros_like(F)
    noise[:3, :3] = (q * since_s**3 / 3 + motion.drift**2 * since_s) * np.eye(3)
    noise[:3, 6:] = noise[6:, :3] = q * since_s * elapsed_s / 2 * np.eye(3)
    noise[6:, 6:] = q * since_s * np.eye(3)
    noise[3:6, 3:6] = (_TURNS if motion.speed else _DRIFTS) ** 2 * since_s * np.eye(3)
    position = target.position_xyz + elapsed_s * target.velocity_xyz
    whole = np.eye(ROBOT.stop)
    whole[OWN, OWN] = F
    joint = whole @ target.joint @ whole.T
    joint[OWN, OWN] += noise
    weight = F @ target.weight @ F.T + noise
    return replace(target, position_xyz=position, joint=joint, weight=weight)


class TargetTracker:
    """Tracks one target; sightings of its parts are fused by their covariances.

    Attributes:
        seen_ns: time of the last sighting; None before the first.
        refused: number of sightings that contradicted the estimate.
        replaced: number of estimates that such sightings have replaced.
        steadiness: of the camera.
    """

    def __init__(self) -> None:
        self._branches: Branches = ()
        self._stamp_ns, self._seen = 0, 1
        self.seen_ns: int | None = None
        self.refused = self.replaced = 0
        self.steadiness = Steadiness(step=_STEP)
        self._camera = RobotError()

    def at(self, stamp_ns: int, motion: TargetMotion) -> LandmarkEstimate | None:
        """The predicted target at a time; None if unknown."""
        if not (now := self._predicted(stamp_ns, motion)):
            return None
        best = now[0].estimate
        whole = known(best.position_xyz, best.R_fixed_landmark, branches.covariance(now))
        return replace(whole, velocity_xyz=best.velocity_xyz)

    def observe(
        self,
        stamp_ns: int,
        sightings: Iterable[PoseReading],
        motion: TargetMotion,
        ground: Ground | None,
        camera: ErrorModel = STEADY,
    ) -> None:
        """Process one sighting of the target, with all its readings.

        Args:
            stamp_ns: of the image.
            sightings: the readings.
            motion: of the target.
            ground: on which it stands, so that a direction alone is enough to start.
            camera: error of its attitude, as stated.
        """
        reading = max(sightings, key=lambda one: _likelihood(one, motion.tilt), default=None)
        if reading is None:
            return
        now = self._predicted(stamp_ns, motion)
        now = self._with_camera(stamp_ns, now, reading, camera)
        now = self._check_steadiness(stamp_ns, now, reading, camera)
        fits = [fit(branch.estimate, reading.expect) for branch in now]
        waited_s = abs(stamp_ns - self._stamp_ns) / 1e9
        loss = min(LOSS, MOVED * waited_s / motion.patience_s)
        if any(one.fit.is_inlier for one in fits):
            found = branches.take(now, fits, loss)
            self._seen += 1
        else:
            begun = _begin(reading, motion, ground, self._camera.covariance)
            new = () if begun is None else (Branch(begun),)
            found = branches.contradict(now, new, self._seen, loss) if now else new
        if not found:
            return
        self.refused += bool(fits) and not fits[0].fit.is_inlier
        self._branches, has_moved = branches.settled(found)
        self.replaced += has_moved
        self._stamp_ns = self.seen_ns = stamp_ns

    def _with_camera(
        self, stamp_ns: int, now: Branches, reading: PoseReading, camera: ErrorModel
    ) -> Branches:
        """Branches with the camera's error at the time of an image."""
        model = camera.at_level(self.steadiness.level)
        kept = self._camera.advance(stamp_ns, reading.camera_xyz, model, None)
        return _each(now, lambda one: one.propagated(kept, self._camera.covariance))

    def _check_steadiness(
        self, stamp_ns: int, now: Branches, reading: PoseReading, camera: ErrorModel
    ) -> Branches:
        """Branches with more room for that error, once images have shown that they need it."""
        before = self.steadiness
        if not now or not camera.attitude_rad or before.is_final:
            return now
        best, more = now[0].estimate, camera.at_level(before.next).attitude_rad ** 2
        robot = self._camera.covariance + np.diag([0.0] * 3 + [more] * 3)
        anew = fit(best.propagated(np.eye(6), robot), reading.expect).fit
        self.steadiness = before.after(fit(best, reading.expect).fit, anew)
        if self.steadiness.level == before.level:
            return now
        now = self._with_camera(stamp_ns, now, reading, camera)
        effect = robot_error_at(best.position_xyz, reading.camera_xyz)
        seen = effect @ self._camera.covariance @ effect.T
        return _each(now, lambda one: one.inflated(seen))

    def forget(self) -> None:
        """Restart with the next sighting."""
        self._branches, self._seen, self.seen_ns = (), 1, None

    def _predicted(self, stamp_ns: int, motion: TargetMotion) -> Branches:
        since_s = (stamp_ns - self._stamp_ns) / 1e9
        return _each(self._branches, lambda one: after(one, since_s, motion))


def _each(several: Branches, change: Callable[[LandmarkEstimate], LandmarkEstimate]) -> Branches:
    return tuple(replace(one, estimate=change(one.estimate)) for one in several)


def _begin(
    reading: PoseReading, motion: TargetMotion, ground: Ground | None, robot: Floats
) -> LandmarkEstimate | None:
    """The estimate from one sighting, with an unknown velocity; None if its position is unknown."""
    R = np.eye(3) if reading.R_fixed_landmark is None else reading.R_fixed_landmark
    position = reading.position_xyz if reading.has_range else None
    if position is None and ground is not None:
        position = ground.meet(reading)
    if position is None:
        return None
    covariance = np.zeros((OWN.stop, OWN.stop))
    covariance[:3, :3] = _VAGUE_M2 * np.eye(3)
    covariance[3:6, 3:6] = _VAGUE_TURN
    if reading.R_fixed_landmark is not None:
        covariance[3:6, 3:6] = math.pi**2 * np.eye(3)
    covariance[6:, 6:] = motion.speed**2 * np.eye(3)
    first = known(position, R, covariance).propagated(np.zeros((6, 6)), robot)
    if ground is not None and not reading.has_range:
        first = fit(first, ground.expect).updated
    return fit(first, reading.expect).updated


def _likelihood(reading: PoseReading, tilt: float) -> float:
    """Log-likelihood of a reading: of its score, and of the target's tilt."""
    score = math.log(max(reading.score, 1e-9))
    if reading.R_fixed_landmark is None:
        return score
    slope = math.acos(float(np.clip(reading.R_fixed_landmark[2, 2], -1, 1)))
    return score - slope**2 / (2 * tilt**2)
