"""The robot's own part of the state: pose, motion, and sensor errors, by name.

Its pose, velocity and previous pose change with the map as a whole, all by one twist
(`ros_visualise.geometry.se3`); so does the GPS origin. Parts that no sensor measures
stay zero with zero covariance: velocity and biases without an IMU, its errors without GPS.

Source: A. Barrau, S. Bonnabel, The invariant extended Kalman filter as a stable observer, 2017 (the
errors of pose and velocity).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import se3

POSE = slice(0, 6)
SCALES = slice(6, 8)
VELOCITY = slice(8, 11)
GYRO = slice(11, 14)
ACCEL = slice(14, 17)
BEFORE = slice(17, 23)
SLOW = slice(23, 26)
GRAVITY = slice(26, 28)
DATUM = slice(28, 32)
CORE = 32

GRAVITY_MS2 = 9.80665
YAW = [0, 1, 2, 5]  # of a twist: the unknowns of a level frame


def _zeros() -> Floats:
    return np.zeros(3)


@dataclass(frozen=True, eq=False)
class RobotState:
    """The robot at one time.

    Attributes:
        R, p: T_map_base, (3, 3) and (3,).
        scales: (2,) scale errors of the odometry's distances and rotations, as fractions.
        v: (3,) velocity, m/s in the map.
        gyro, accel: (3,) IMU biases in the robot's axes, rad/s and m/s^2.
        before_R, before_p: pose at the previous odometry message, where its next motion starts.
        slow: (3,) slow GPS error, in standard deviations.
        gravity: (3,) m/s^2 in the map; the errors of its first two components are the map's tilt.
        datum_R, datum_p: T_map_enu, the GPS origin.
    """

    R: Floats = field(default_factory=lambda: np.eye(3))
    p: Floats = field(default_factory=_zeros)
    scales: Floats = field(default_factory=lambda: np.zeros(2))
    v: Floats = field(default_factory=_zeros)
    gyro: Floats = field(default_factory=_zeros)
    accel: Floats = field(default_factory=_zeros)
    before_R: Floats = field(default_factory=lambda: np.eye(3))
    before_p: Floats = field(default_factory=_zeros)
    slow: Floats = field(default_factory=_zeros)
    gravity: Floats = field(default_factory=lambda: np.array([0.0, 0, -GRAVITY_MS2]))
    datum_R: Floats = field(default_factory=lambda: np.eye(3))
    datum_p: Floats = field(default_factory=_zeros)

    def standing(self) -> RobotState:
        """The same, with the present pose as the previous one."""
        return replace(self, before_R=self.R, before_p=self.p)

    def moved(self, error: Floats) -> RobotState:
        """The same, corrected by an error (CORE,)."""
        several = np.zeros((4, 6))
        several[0], several[1] = error[POSE], error[BEFORE]
        several[2, YAW] = error[DATUM]
        several[3, :3], several[3, 3:] = error[VELOCITY], error[3:6]
        R, p = se3.moved(
            several,
            np.array([self.R, self.before_R, self.datum_R, self.R]),
            np.array([self.p, self.before_p, self.datum_p, self.v]),
        )
        return replace(
            self,
            R=R[0],
            p=p[0],
            scales=self.scales + error[SCALES],
            v=p[3],
            gyro=self.gyro + error[GYRO],
            accel=self.accel + error[ACCEL],
            before_R=R[1],
            before_p=p[1],
            slow=self.slow + error[SLOW],
            gravity=self.gravity + np.append(error[GRAVITY], 0.0),
            datum_R=R[2],
            datum_p=p[2],
        )
