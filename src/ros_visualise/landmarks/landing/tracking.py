"""Tracking of a landing target: a Kalman filter of its pose and velocity.

All quantities are in a fixed frame, such as ``odom``. The error state has nine numbers, along its
axes: position in metres, orientation as a rotation vector, velocity in m/s. The target moves at
constant velocity, disturbed by white acceleration noise; its rotation is a random walk, and so is
the drift of the fixed frame. Sightings that contradict the estimate begin another one, see
`ros_visualise.landmarks.localization.branches`; they cost the former in proportion to time.

Source: Bar-Shalom, Li and Kirubarajan, Estimation with applications to tracking and navigation,
2001, sections 6.2 (the noise) and 5.4 (the gate).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.landmarks.localization import branches
from ros_visualise.landmarks.localization.branches import LOSS, MOVED, Branch, Branches
from ros_visualise.landmarks.localization.estimate import OWN, LandmarkEstimate, fit, known
from ros_visualise.landmarks.localization.seen import Ground, PoseReading

_VAGUE_TURN = np.diag((0.1**2, 0.1**2, math.pi**2))  # rad^2, unknown orientation
_TURNS = 0.1  # rad/sqrt(s), of a target that moves
_DRIFTS = 0.01  # rad/sqrt(s), of the fixed frame
_VAGUE_M2 = 1e4


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
    predicted = known(position, target.R_fixed_landmark, F @ target.covariance @ F.T + noise)
    return replace(predicted, velocity_xyz=target.velocity_xyz)


class TargetTracker:
    """Tracks one target; sightings of its parts are fused by their covariances.

    Attributes:
        seen_ns: time of the last sighting; None before the first.
        refused: number of sightings that contradicted the estimate.
        replaced: number of estimates that such sightings have replaced.
    """

    def __init__(self) -> None:
        self._branches: Branches = ()
        self._stamp_ns, self._seen = 0, 1
        self.seen_ns: int | None = None
        self.refused = self.replaced = 0

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
    ) -> None:
        """Process one sighting of the target, with all its readings.

        Args:
            stamp_ns: of the image.
            sightings: the readings.
            motion: of the target.
            ground: on which it stands, so that a direction alone is enough to start.
        """
        reading = max(sightings, key=lambda one: _likelihood(one, motion.tilt), default=None)
        if reading is None:
            return
        now = self._predicted(stamp_ns, motion)
        fits = [fit(branch.estimate, reading.expect) for branch in now]
        waited_s = abs(stamp_ns - self._stamp_ns) / 1e9
        loss = min(LOSS, MOVED * waited_s / motion.patience_s)
        if any(one.fit.is_inlier for one in fits):
            found = branches.take(now, fits, loss)
            self._seen += 1
        else:
            begun = _begin(reading, motion, ground)
            new = () if begun is None else (Branch(begun),)
            found = branches.contradict(now, new, self._seen, loss) if now else new
        if not found:
            return
        self.refused += bool(fits) and not fits[0].fit.is_inlier
        self._branches, has_moved = branches.settled(found)
        self.replaced += has_moved
        self._stamp_ns = self.seen_ns = stamp_ns

    def forget(self) -> None:
        """Restart with the next sighting."""
        self._branches, self._seen, self.seen_ns = (), 1, None

    def _predicted(self, stamp_ns: int, motion: TargetMotion) -> Branches:
        since_s = (stamp_ns - self._stamp_ns) / 1e9
        return tuple(
            replace(b, estimate=after(b.estimate, since_s, motion)) for b in self._branches
        )


def _begin(
    reading: PoseReading, motion: TargetMotion, ground: Ground | None
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
    first = known(position, R, covariance)
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
