"""An inertial measurement unit with an attitude estimate (REP 145)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from ros_visualise.data import Floats, Header, Imu
from ros_visualise.data.header import read_only
from ros_visualise.simulation.attitude import Quat, from_rotation_vector, multiply, xyzw
from ros_visualise.simulation.delivery import delivered
from ros_visualise.simulation.noise import GaussMarkov, Interval, random_of
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting

_imu = partial(setting, group="imu")


@delivered("imu", "imu")
@dataclass(frozen=True)
class ImuParams:
    """Parameters of an inertial measurement unit."""

    imu_rate: float = _imu(100.0, "measurements per second", min=1, max=200)
    gyro_density: float = _imu(3e-4, "gyroscope noise density, rad/s/sqrt(Hz)", min=0, max=0.1)
    gyro_bias: float = _imu(5e-3, "gyroscope bias (standard deviation), rad/s", min=0, max=0.5)
    gyro_walk: float = _imu(2e-5, "gyroscope bias random walk, rad/s^2/sqrt(Hz)", min=0, max=0.01)
    accel_density: float = _imu(2e-3, "accelerometer noise density, m/s^2/sqrt(Hz)", min=0, max=1)
    accel_bias: float = _imu(0.05, "accelerometer bias (standard deviation), m/s^2", min=0, max=5)
    accel_walk: float = _imu(2e-4, "accelerometer bias random walk, m/s^3/sqrt(Hz)", min=0, max=0.1)
    imu_attitude: float = _imu(
        0.01,
        "slowly varying error of the attitude about each axis (standard deviation), rad",
        min=0,
        max=0.5,
    )
    imu_attitude_time: float = _imu(
        30.0, "time constant of the attitude's varying error, seconds", min=0.1, max=1e4
    )


class ImuSensor:
    """Rates and accelerations with white noise and walking biases, and a slowly drifting attitude.

    Source: Woodman, An introduction to inertial navigation, 2007, chapters 3 and 4.
    """

    frame_id = "imu_link"

    def __init__(self, params: ImuParams, seed: int) -> None:
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
            motion: (6,) angular velocity in rad/s and specific force in m/s^2, in the sensor's
                axes.
        """
        noise = self._random.standard_normal(12)
        elapsed_s = self._interval.until(stamp_ns)
        self._bias = self._bias + self._walk * math.sqrt(elapsed_s) * noise[6:]
        measured = motion + self._bias + self._white * noise[:6]
        tilt = self._tilt.at(stamp_ns).tolist()
        estimate = multiply(attitude, from_rotation_vector(*tilt))
        turn, angular, linear = self._covariances
        header = Header(stamp_ns, self.frame_id)
        return Imu(xyzw(estimate), measured[:3], measured[3:], turn, angular, linear, header)


def fit(fitting: Fitting) -> Measure:
    """The sensor in the body."""
    body, imu = fitting.robot.body, ImuSensor(fitting.settings, fitting.seed)
    return lambda stamp_ns, _: {"imu": imu.measure(stamp_ns, body.attitude, body.motion())}


SENSOR = SensorType(ImuParams, {"imu": Imu}, "imu_rate", fit, always=True, delivery="imu")
