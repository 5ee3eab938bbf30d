"""An inertial measurement unit with an attitude estimate (REP 145)."""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.data import Floats, Header, Imu
from ros_visualise.data.header import read_only
from ros_visualise.simulation.attitude import Quat, from_rotation_vector, multiply, xyzw
from ros_visualise.simulation.sensors.noise import GaussMarkov, Interval, random_of
from ros_visualise.simulation.settings import RobotParams


class ImuSensor:
    """Rates and accelerations with white noise and a bias that walks, and a slowly wrong attitude.

    Source: Woodman, An introduction to inertial navigation, 2007, chapters 3 and 4.
    """

    frame_id = "imu_link"

    def __init__(self, params: RobotParams, seed: int) -> None:
        self._random = random_of(seed, "imu")
        density = np.repeat([params.gyro_density, params.accel_density], 3)
        self._white = density * math.sqrt(params.imu_rate)
        self._walk = np.repeat([params.gyro_walk, params.accel_walk], 3)
        bias = np.repeat([params.gyro_bias, params.accel_bias], 3)
        self._bias: Floats = bias * self._random.standard_normal(6)
        tilt = np.full(3, params.imu_attitude)
        self._tilt = GaussMarkov(self._random, tilt, params.imu_attitude_time)
        self._interval = Interval()
        self._covariances = tuple(
            read_only(np.eye(3) * variance)
            for variance in (params.imu_attitude**2, self._white[0] ** 2, self._white[3] ** 2)
        )

    def measure(self, stamp_ns: int, attitude: Quat, motion: Floats) -> Imu:
        """One measurement.

        Args:
            attitude: of the body in the world.
            motion: (6,) turn rates in rad/s and specific force in m/s^2, in the sensor's axes.
        """
        noise = self._random.standard_normal(12)
        elapsed_s = self._interval.until(stamp_ns)
        self._bias = self._bias + self._walk * math.sqrt(elapsed_s) * noise[6:]
        measured = motion + self._bias + self._white * noise[:6]
        tilt = self._tilt.step(elapsed_s).tolist()
        estimate = multiply(attitude, from_rotation_vector(*tilt))
        orientation, angular, linear = self._covariances
        return Imu(
            xyzw(estimate),
            measured[:3],
            measured[3:],
            orientation,
            angular,
            linear,
            Header(stamp_ns, self.frame_id),
        )
