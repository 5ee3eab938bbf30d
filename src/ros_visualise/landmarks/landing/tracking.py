"""Tracking of a landing target: a Kalman filter of its pose and velocity.

All quantities are in a fixed frame, such as ``odom``. The error state has nine numbers, along its
axes: position in metres, orientation as a rotation vector, velocity in m/s. The target moves at
constant velocity, disturbed by white acceleration noise; its rotation is a random walk, and so is
the drift of the fixed frame. A sighting that contradicts the estimate begins a rival estimate, and
the covariance includes the rival until one of the two prevails.

Source: Bar-Shalom, Li and Kirubarajan, Estimation with applications to tracking and navigation,
2001, sections 6.2 (the noise), 5.4 (the gate) and 1.4.16 (the covariance of two alternatives).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import se3
from ros_visualise.landmarks.localization.estimate import GATES
from ros_visualise.landmarks.localization.seen import Equations, Ground, PoseReading

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
        patience_s: how long sightings may contradict the estimate before they replace it.
    """

    speed: float = 1.0
    acceleration: float = 0.5
    tilt: float = math.radians(10)
    drift: float = 0.01
    patience_s: float = 0.5


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
        q = motion.acceleration**2 if motion.speed else 0.0
        noise = np.zeros((9, 9))
        noise[:3, :3] = (q * since_s**3 / 3 + motion.drift**2 * since_s) * np.eye(3)
        noise[:3, 6:] = noise[6:, :3] = q * since_s * elapsed_s / 2 * np.eye(3)
        noise[6:, 6:] = q * since_s * np.eye(3)
        noise[3:6, 3:6] = (_TURNS if motion.speed else _DRIFTS) ** 2 * since_s * np.eye(3)
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
        position, velocity = self.position_xyz + step[:3], self.velocity_xyz + step[6:]
        return TargetEstimate(position, se3.exp(step[:6])[0] @ self.R, velocity, covariance)

    def covering(self, other: TargetEstimate, share: float) -> TargetEstimate:
        """The same with the covariance of two alternatives; ``share``: the other's probability."""
        off = np.concatenate(
            [
                other.position_xyz - self.position_xyz,
                se3.turn_between(other.R, self.R),
                other.velocity_xyz - self.velocity_xyz,
            ]
        )
        there = other.covariance + np.outer(off, off)
        return replace(self, covariance=(1 - share) * self.covariance + share * there)

    def _spread(self, equations: Equations) -> Floats:
        H = _nine(equations.H)
        spread: Floats = H @ self.covariance @ H.T + equations.noise
        return spread


@dataclass(frozen=True)
class _Track:
    """An estimate at the time of its last sighting, and the number of sightings."""

    estimate: TargetEstimate
    stamp_ns: int
    seen: int = 1

    def at(self, stamp_ns: int, motion: TargetMotion) -> TargetEstimate:
        return self.estimate.after((stamp_ns - self.stamp_ns) / 1e9, motion)

    def follow(self, stamp_ns: int, reading: PoseReading, motion: TargetMotion) -> _Track | None:
        """The track with one more sighting; None if that contradicts it."""
        now = self.at(stamp_ns, motion)
        equations = reading.expect(now.position_xyz, now.R)
        if now.distance(equations) > GATES[len(equations.residual)]:
            return None
        return _Track(now.corrected(equations), stamp_ns, self.seen + 1)


class TargetTracker:
    """Tracks one target; sightings of its parts are fused by their covariances.

    Attributes:
        refused: number of contradicting sightings.
        replaced: number of estimates that contradicting sightings have replaced.
    """

    def __init__(self) -> None:
        self._track: _Track | None = None
        self._rival: _Track | None = None
        self._contested = 0  # sightings in a row that contradict the track
        self._contested_ns = 0  # time of the first of these
        self.refused = self.replaced = 0

    @property
    def seen_ns(self) -> int | None:
        """Time of the last sighting of the estimate or its rival; None before the first."""
        tracks = [one.stamp_ns for one in (self._track, self._rival) if one is not None]
        return max(tracks, default=None)

    def at(self, stamp_ns: int, motion: TargetMotion) -> TargetEstimate | None:
        """The predicted target at a time; None if unknown."""
        if self._track is None:
            return None
        estimate = self._track.at(stamp_ns, motion)
        if self._rival is None:
            return estimate
        doubt = self._doubt(self._track, self._rival, motion)
        return estimate.covering(self._rival.at(stamp_ns, motion), doubt)

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
        if self._track is None:
            self._track = _begin(stamp_ns, reading, motion, ground)
        elif (followed := self._track.follow(stamp_ns, reading, motion)) is not None:
            self._track, self._rival, self._contested = followed, None, 0
        else:
            self._contest(self._track, stamp_ns, reading, motion, ground)

    def forget(self) -> None:
        """Restart with the next sighting."""
        self._track = self._rival = None
        self._contested = 0

    def _contest(
        self,
        track: _Track,
        stamp_ns: int,
        reading: PoseReading,
        motion: TargetMotion,
        ground: Ground | None,
    ) -> None:
        """Follow sightings that contradict the estimate; they replace it when they prevail."""
        self.refused += 1
        self._contested_ns = self._contested_ns if self._contested else stamp_ns
        self._contested += 1
        followed = self._rival.follow(stamp_ns, reading, motion) if self._rival else None
        self._rival = followed or _begin(stamp_ns, reading, motion, ground) or self._rival
        if self._rival is not None and self._doubt(track, self._rival, motion) >= 1:
            self._track, self._rival, self._contested = self._rival, None, 0
            self.replaced += 1

    def _doubt(self, track: _Track, rival: _Track, motion: TargetMotion) -> float:
        """Probability of the rival, by its share of sightings and by time; 1: it has prevailed."""
        if rival.seen > track.seen:
            return 1.0
        share = self._contested / (self._contested + track.seen)
        lasted_s = abs(rival.stamp_ns - self._contested_ns) / 1e9
        return min(1.0, max(share, lasted_s / motion.patience_s))


def _begin(
    stamp_ns: int, reading: PoseReading, motion: TargetMotion, ground: Ground | None
) -> _Track | None:
    """A track from one sighting, with an unknown velocity; None if its position is unknown."""
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
    first = TargetEstimate(position, R, np.zeros(3), covariance)
    if ground is not None and not reading.has_range:
        first = first.corrected(ground.expect(position, R))
    seen = first.corrected(reading.expect(first.position_xyz, first.R))
    return _Track(seen, stamp_ns)


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
