"""Tracking of a landing target: a Kalman filter of its pose and velocity.

All quantities are in a fixed frame, such as ``odom``. The error state has nine numbers, along its
axes: position in metres, orientation as a rotation vector, velocity in m/s. The target moves at
constant velocity, disturbed by white acceleration noise; its rotation is a random walk.

Source: Bar-Shalom, Li and Kirubarajan, Estimation with applications to tracking and navigation,
2001, sections 6.2 (the noise) and 5.4 (the gate).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.localization.seen import Equations, Ground, PoseReading

_GATE = {1: 10.8, 2: 13.8, 3: 16.3, 6: 22.5}  # 99.9 % points of chi-square
_VAGUE_TURN = np.diag((0.1**2, 0.1**2, math.pi**2))  # rad^2, unknown orientation
_TURNS = 0.1  # rad/sqrt(s)
_VAGUE_M2 = 1e4


@dataclass(frozen=True)
class TargetMotion:
    """Motion model of a target.

    Attributes:
        speed: standard deviation of its initial velocity, m/s; 0: it stands still.
        acceleration: standard deviation of its velocity change in one second, m/s.
        tilt: standard deviation of its tilt, radians: of two readings of an image, the more level
            one is likelier.
    """

    speed: float = 1.0
    acceleration: float = 0.5
    tilt: float = math.radians(10)


@dataclass(frozen=True)
class TargetEstimate:
    """The target: ``position_xyz`` (3,), ``R`` (3, 3), ``velocity_xyz`` (3,)."""

    position_xyz: Floats
    R: Floats
    velocity_xyz: Floats
    covariance: Floats

    def after(self, elapsed_s: float, motion: TargetMotion) -> TargetEstimate:
        """The prediction for a later or earlier time, with larger covariance."""
        F, since_s = np.eye(9), abs(elapsed_s)
        F[:3, 6:] = elapsed_s * np.eye(3)
        noise = np.zeros((9, 9))
        if motion.speed:
            q = motion.acceleration**2
            noise[:3, :3] = q * since_s**3 / 3 * np.eye(3)
            noise[:3, 6:] = noise[6:, :3] = q * since_s * elapsed_s / 2 * np.eye(3)
            noise[6:, 6:] = q * since_s * np.eye(3)
            noise[3:6, 3:6] = _TURNS**2 * since_s * np.eye(3)
        position = self.position_xyz + elapsed_s * self.velocity_xyz
        covariance = F @ self.covariance @ F.T + noise
        return TargetEstimate(position, self.R, self.velocity_xyz, covariance)

    def distance(self, equations: Equations) -> float:
        """Squared Mahalanobis distance of a measurement."""
        residual = equations.residual
        return float(residual @ np.linalg.solve(self._spread(equations), residual))

    def corrected(self, equations: Equations) -> TargetEstimate:
        """The estimate updated by a measurement."""
        H = _nine(equations.H)
        gain = np.linalg.solve(self._spread(equations), H @ self.covariance).T
        step = gain @ equations.residual
        rest = np.eye(9) - gain @ H
        covariance = rest @ self.covariance @ rest.T + gain @ equations.noise @ gain.T
        turn = np.asarray(cv2.Rodrigues(step[3:6])[0], np.float64)
        position, velocity = self.position_xyz + step[:3], self.velocity_xyz + step[6:]
        return TargetEstimate(position, turn @ self.R, velocity, covariance)

    def _spread(self, equations: Equations) -> Floats:
        H = _nine(equations.H)
        spread: Floats = H @ self.covariance @ H.T + equations.noise
        return spread


class TargetTracker:
    """Tracks one target; sightings of its parts are fused by their covariances.

    Attributes:
        estimate: at ``stamp_ns``; None before the first sighting.
        seen_ns: time of the last sighting.
        refused: number of contradicting sightings.
    """

    def __init__(self) -> None:
        self.estimate: TargetEstimate | None = None
        self.stamp_ns = self.seen_ns = 0
        self.refused = 0

    def at(self, stamp_ns: int, motion: TargetMotion) -> TargetEstimate | None:
        """The predicted target at a time; None if unknown."""
        if self.estimate is None:
            return None
        return self.estimate.after((stamp_ns - self.stamp_ns) / 1e9, motion)

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
        now = self.at(stamp_ns, motion)
        if now is None:
            now = _begin(reading, motion, ground)
            if now is None:
                return
        equations = reading.expect(now.position_xyz, now.R)
        if now.distance(equations) > _GATE[len(equations.residual)]:
            self.refused += 1
            return
        self.estimate = now.corrected(equations)
        self.stamp_ns = self.seen_ns = stamp_ns

    def forget(self) -> None:
        """Restart with the next sighting."""
        self.estimate = None


def _begin(
    reading: PoseReading, motion: TargetMotion, ground: Ground | None
) -> TargetEstimate | None:
    """The first estimate: the measured pose, and an unknown velocity."""
    R = np.eye(3) if reading.R_fixed_landmark is None else reading.R_fixed_landmark
    position = reading.position_xyz if reading.has_range else None
    if position is None and ground is not None:
        position = ground.meet(reading)
    if position is None:
        return None
    covariance = np.zeros((9, 9))
    covariance[:3, :3] = _VAGUE_M2 * np.eye(3)
    covariance[3:6, 3:6] = _VAGUE_TURN
    if reading.R_fixed_landmark is not None:
        covariance[3:6, 3:6] = math.pi**2 * np.eye(3)
    covariance[6:, 6:] = motion.speed**2 * np.eye(3)
    vague = TargetEstimate(position, R, np.zeros(3), covariance)
    if reading.has_range or ground is None:
        return vague
    return vague.corrected(ground.expect(position, R))


def _likelihood(reading: PoseReading, tilt: float) -> float:
    """Log-likelihood of a reading: of its score, and of the target's tilt."""
    score = math.log(max(reading.score, 1e-9))
    if reading.R_fixed_landmark is None:
        return score
    slope = math.acos(float(np.clip(reading.R_fixed_landmark[2, 2], -1, 1)))
    return score - slope**2 / (2 * tilt**2)


def _nine(H: Floats) -> Floats:
    """Pad H with zeros: a pose measurement does not depend on the velocity."""
    return np.hstack([H, np.zeros((len(H), 3))])
