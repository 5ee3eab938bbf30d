"""The mount of a camera: fixed to the body, or a gimbal; with the errors of its frame on tf."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.simulation.attitude import (
    Quat,
    conjugate,
    from_rotation_vector,
    from_yaw,
    multiply,
    rows,
    yaw_of,
)
from ros_visualise.simulation.model import site_position
from ros_visualise.simulation.noise import GaussMarkov, random_of
from ros_visualise.simulation.sensors import setting
from ros_visualise.simulation.sensors.camera import CameraSensorParams

_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # R_camera_optical
TO_OPTICAL: Quat = (0.5, -0.5, 0.5, -0.5)
"""The same."""
_LEVEL: Quat = (1.0, 0.0, 0.0, 0.0)

_gimbal = partial(setting, group="camera")


@dataclass(frozen=True)
class GimbalParams(CameraSensorParams):
    """Parameters of a camera on a gimbal."""

    camera_gimbal: bool = _gimbal(
        True, "keep the camera level with a gimbal while the body rolls and pitches"
    )
    gimbal_error: float = _gimbal(
        0.0,
        "slowly varying error of the gimbal about each axis (standard deviation), degrees; tf does"
        " not show it",
        min=0,
        max=10,
    )
    gimbal_error_time: float = _gimbal(
        5.0, "time constant of the gimbal's varying error, seconds", min=0.1, max=1e4
    )
    gimbal_lag: float = _gimbal(
        0.0, "age of the gimbal's angles when they are published on tf, seconds", min=0, max=1
    )


class CameraMount:
    """Attitude of the camera, true and on tf.

    Args:
        settings: camera parameters, including its pitch, and maybe those of a gimbal, which keeps
            the camera level while the body rolls and pitches.
        seed: of its errors.

    Attributes:
        moves: True if it has a gimbal.
        position: (3,) metres on the body.
    """

    def __init__(self, model: Any, settings: CameraSensorParams, seed: int) -> None:
        self.moves = isinstance(settings, GimbalParams) and settings.camera_gimbal
        self.position = site_position(model, "camera_link")
        pitch = math.radians(settings.camera_pitch)
        self._pitch: Quat = (math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0)
        random = random_of(seed, "camera_mount")
        constant = math.radians(settings.camera_misalignment) * random.standard_normal(3)
        self._constant: Quat = from_rotation_vector(*constant.tolist())
        self._off = self._constant
        self._wander: GaussMarkov | None = None
        self._lag_ns = 0
        if isinstance(settings, GimbalParams) and self.moves:
            deviation = np.full(3, math.radians(settings.gimbal_error))
            self._wander = GaussMarkov(random, deviation, settings.gimbal_error_time)
            self._lag_ns = round(1e9 * settings.gimbal_lag)
        self._angles: deque[tuple[int, Quat]] = deque([(0, self._pitch)])

    def advance(self, stamp_ns: int, attitude: Quat) -> None:
        """Follow the body; called for each odometry, whatever has listeners."""
        if self._wander is None:
            return
        self._off = multiply(self._constant, from_rotation_vector(*self._wander.at(stamp_ns)))
        self._angles.append((stamp_ns, self._angle(attitude)))
        while len(self._angles) > 2 and self._angles[1][0] <= stamp_ns - self._lag_ns:
            self._angles.popleft()

    def reported(self, stamp_ns: int) -> Quat:
        """Attitude of the camera on the body on tf, at the time of `advance`."""
        if not self._lag_ns:
            return self._angles[-1][1]
        then_ns = stamp_ns - self._lag_ns
        (before_ns, before), *later = self._angles
        if not later or then_ns <= before_ns:
            return before
        after_ns, after = later[0]
        part = min((then_ns - before_ns) / (after_ns - before_ns), 1.0)
        sign = math.copysign(1.0, sum(a * b for a, b in zip(before, after, strict=True)))
        mixed = [(1 - part) * a + part * sign * b for a, b in zip(before, after, strict=True)]
        size = math.sqrt(sum(each * each for each in mixed))
        w, x, y, z = (each / size for each in mixed)
        return w, x, y, z

    def optical_in_map(self, position: Floats, R_map_body: Floats) -> tuple[Floats, Floats]:
        """Position of the camera in ``map``, (3,), and R_map_optical."""
        level = R_map_body
        if self.moves:
            level = np.array(rows(from_yaw(math.atan2(R_map_body[1, 0], R_map_body[0, 0]))))
        turn = np.array(rows(multiply(self._pitch, self._off)))
        return position + R_map_body @ self.position, level @ turn @ _OPTICAL

    def motion_in_map(
        self, R_map_body: Floats, linear: Floats, angular: Floats
    ) -> tuple[Floats, Floats]:
        """Linear and angular velocity of the camera in ``map``, for those of the body in its axes.

        The slow errors of a gimbal do not count.
        """
        velocity = R_map_body @ (linear + np.cross(angular, self.position))
        turn = R_map_body @ angular
        if self.moves:
            ahead = R_map_body[:, 0]
            moved = np.cross(turn, ahead)
            square = ahead[0] ** 2 + ahead[1] ** 2
            turn = np.array([0.0, 0.0, (ahead[0] * moved[1] - ahead[1] * moved[0]) / square])
        return velocity, turn

    def _angle(self, attitude: Quat) -> Quat:
        """True attitude of an exact gimbal on the body."""
        return multiply(conjugate(attitude), multiply(from_yaw(yaw_of(attitude)), self._pitch))
