"""Navigation by external vision, where a simulated vehicle has no GPS.

The vehicle's own odometry drifts; poses of ODOMETRY or VISION_POSITION_ESTIMATE correct its
position and heading by a Kalman filter of the four numbers of that correction. Roll and pitch stay
its own. Poses that disagree are rejected; a new reset_counter, or disagreement that lasts, resets
the estimate to the poses; without them for a while it has no position any more.

Source: PX4 1.14, the parameters EKF2_* named here, and its user guide, Using vision or motion
capture systems. There inertial sensors are propagated where odometry is here.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats

_KEPT_S = 1.0  # of its own odometry
_DRIFT = np.array([0.05, 0.05, 0.05, math.radians(0.5)]) ** 2  # variances per second
_DIAGONAL = (0, 6, 11, 20)  # x, y, z and yaw in the upper triangle of a covariance
_HEADING_GATE = 2.6  # standard deviations, EKF2_HDG_GATE
_BACK_US = 1_000_000  # stamps that go back further are those of another clock


class VisionPose(NamedTuple):
    """A pose of the body in its local frame.

    Attributes:
        position: north, east, down.
        yaw: heading, radians.
        covariance: its 21 numbers as in the message.
        resets: reset_counter.
        stamp_us: by the sender's clock; only its order counts.
    """

    position: Floats
    yaw: float
    covariance: Floats
    resets: int
    stamp_us: int


class _Own(NamedTuple):
    """The odometry at a time: north, east, down, heading."""

    time_s: float
    numbers: Floats


class VisionAid:
    """Estimates what takes the vehicle's odometry to the frame of the poses that it is sent.

    Args:
        parameters: of the vehicle; may change at any time.
        say: shows a text to ground stations.

    Attributes:
        yaw: turn of the odometry to the right.
        shift: and its shift after that: north, east, down.
        variances: of north, east, down and heading of the estimate.
        resets: number of times that the estimate jumped.
        rejected: number of poses that disagreed.
    """

    def __init__(self, parameters: dict[str, float], say: Callable[[str], None]) -> None:
        self._p, self._say = parameters, say
        self.yaw, self.shift = 0.0, np.zeros(3)
        self.variances = np.zeros(4)
        self.resets = self.rejected = 0
        self._past: deque[_Own] = deque()
        self._fused_s = self._agreed_s = -math.inf
        self._their_resets: int | None = None
        self._stamp_us = 0
        self._is_said = self._was_valid = False

    @property
    def is_valid(self) -> bool:
        """True while the position estimate is valid."""
        return bool(self._past) and self._past[-1].time_s - self._fused_s <= self._limit_s

    @property
    def _limit_s(self) -> float:
        return self._p["EKF2_NOAID_TOUT"] / 1e6

    @property
    def here(self) -> Floats:
        """Its position: north, east, down."""
        own = self._past[-1].numbers[:3] if self._past else np.zeros(3)
        return self.turned(own) + self.shift

    def follow(self, time_s: float, position: Floats, yaw: float) -> bool:
        """Take its own odometry; true if the position was lost just now."""
        if self._past:
            self.variances = self.variances + (time_s - self._past[-1].time_s) * _DRIFT
        self._past.append(_Own(time_s, np.array([*position, yaw])))
        while time_s - self._past[0].time_s > _KEPT_S:
            self._past.popleft()
        was_valid, self._was_valid = self._was_valid, self.is_valid
        is_lost = was_valid and not self._was_valid
        if is_lost:
            self._say("Vision position timeout")
        return is_lost

    def turned(self, vector: Floats) -> Floats:
        """A vector of its odometry in the frame of the poses."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]])

    def fuse(self, pose: VisionPose) -> bool:
        """Take a pose; true if the estimate jumped to it."""
        late_us = self._stamp_us - pose.stamp_us
        if not self._past or not np.isfinite([*pose.position, pose.yaw]).all():
            return False
        if 0 <= late_us < _BACK_US and self._stamp_us:
            return False
        self._stamp_us = pose.stamp_us
        now_s, noise = self._past[-1].time_s, self._noise(pose.covariance)
        then = self._at(now_s - self._p["EKF2_EV_DELAY"] / 1e3)
        is_new = pose.resets != self._their_resets
        self._their_resets = pose.resets
        if is_new or not self.is_valid:
            self._reset(pose, then, noise, "Vision position started" if not self.resets else "")
            return True
        off = np.array([*pose.position, pose.yaw]) - self._estimate(then)
        off[3] = math.remainder(off[3], math.tau)
        ratios = off**2 / (self.variances + noise)
        agrees = ratios <= np.array([self._p["EKF2_EVP_GATE"]] * 3 + [_HEADING_GATE]) ** 2
        if not agrees[:3].all():
            return self._reject(pose, then, noise)
        self._agreed_s = self._fused_s = now_s
        self._is_said = False
        gain = self.variances / (self.variances + noise) * agrees
        self._move(gain * off, then)
        self.variances = (1 - gain) * self.variances
        return False

    def _reject(self, pose: VisionPose, then: Floats, noise: Floats) -> bool:
        """Count a pose that disagrees; if that lasts, believe it."""
        self.rejected += 1
        if not self._is_said:
            self._say("Vision position rejected")
            self._is_said = True
        if self._past[-1].time_s - self._agreed_s <= self._limit_s / 2:
            return False
        self._reset(pose, then, noise, "")
        return True

    def _reset(self, pose: VisionPose, then: Floats, noise: Floats, text: str) -> None:
        """Jump to a pose."""
        off = np.array([*pose.position, pose.yaw]) - self._estimate(then)
        off[3] = math.remainder(off[3], math.tau)
        self._move(off, then)
        self.variances, self.resets = noise, self.resets + 1
        self._agreed_s = self._fused_s = self._past[-1].time_s
        self._was_valid, self._is_said = True, False
        self._say(text or "Reset to vision position")

    def _noise(self, covariance: Floats) -> Floats:
        """Variances of a pose; parameters are their floor, and take the place of unknown ones."""
        floor = np.array([self._p["EKF2_EVP_NOISE"]] * 3 + [self._p["EKF2_EVA_NOISE"]]) ** 2
        told = np.asarray(covariance, np.float64)[list(_DIAGONAL)]
        noise: Floats = np.maximum(np.where(np.isfinite(told), told, 0.0), floor)
        return noise

    def _at(self, time_s: float) -> Floats:
        """Its odometry nearest to a time."""
        return min(self._past, key=lambda one: abs(one.time_s - time_s)).numbers

    def _estimate(self, own: Floats) -> Floats:
        return np.array([*(self.turned(own[:3]) + self.shift), own[3] + self.yaw])

    def _move(self, off: Floats, then: Floats) -> None:
        """Change the estimate at that time, the heading about the vehicle."""
        moved = self._estimate(then)[:3] + off[:3]
        self.yaw += float(off[3])
        self.shift = moved - self.turned(then[:3])
