"""A magnetometer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from ros_visualise.data import Floats, Header, MagneticField
from ros_visualise.simulation.delivery import delivered
from ros_visualise.simulation.noise import GaussMarkov, random_of
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting

_TESLA = 1e-6

_magnetometer = partial(setting, group="magnetometer")


@delivered("mag", "magnetometer")
@dataclass(frozen=True)
class MagnetometerParams:
    """Parameters of a magnetometer."""

    mag_rate: float = _magnetometer(50.0, "measurements per second", min=1, max=200)
    mag_noise: float = _magnetometer(
        0.3, "noise of each axis (standard deviation), microtesla", min=0, max=100
    )
    mag_bias: float = _magnetometer(
        1.0, "bias of each axis (standard deviation), microtesla", min=0, max=100
    )
    mag_strength: float = _magnetometer(
        48.6, "strength of the Earth's field, microtesla", min=1, max=100
    )
    mag_inclination: float = _magnetometer(
        64.8, "inclination: angle of the Earth's field below horizontal, degrees", min=-90, max=90
    )
    mag_declination: float = _magnetometer(
        2.9, "declination: angle of magnetic north east of true north, degrees", min=-180, max=180
    )
    mag_disturbance: float = _magnetometer(
        0.0,
        "slowly varying error on each axis from nearby iron and currents (standard deviation),"
        " microtesla",
        min=0,
        max=100,
    )
    mag_disturbance_time: float = _magnetometer(
        10.0, "time constant of the varying error, seconds", min=0.1, max=1e4
    )


class Magnetometer:
    """The Earth's field in the body's axes, with a bias (the body's magnetism) and white noise.

    A disturbance in the world adds to the field. The covariance is that of all errors together.
    """

    frame_id = "imu_link"

    def __init__(self, params: MagnetometerParams, seed: int) -> None:
        self._random = random_of(seed, "magnetometer")
        dip, east = math.radians(params.mag_inclination), math.radians(params.mag_declination)
        level, down = math.cos(dip), math.sin(dip)
        field = np.array([level * math.sin(east), level * math.cos(east), -down])
        self._field_enu = field * params.mag_strength * _TESLA
        self._bias = params.mag_bias * _TESLA * self._random.standard_normal(3)
        self._white = params.mag_noise * _TESLA
        deviation = np.full(3, params.mag_disturbance * _TESLA)
        random = random_of(seed, "magnetic_disturbance")
        self._disturbance = GaussMarkov(random, deviation, params.mag_disturbance_time)
        bias = params.mag_bias * _TESLA
        self._covariance = np.eye(3) * (self._white**2 + bias**2 + deviation[0] ** 2)

    def measure(self, stamp_ns: int, R_map_body: Floats) -> MagneticField:
        """The field measured at an attitude."""
        noise = self._white * self._random.standard_normal(3)
        field = self._field_enu + self._disturbance.at(stamp_ns)
        measured = field @ R_map_body + self._bias + noise
        return MagneticField(measured, self._covariance, Header(stamp_ns, self.frame_id))


def fit(fitting: Fitting) -> Measure:
    """The sensor in the body."""
    body, magnetometer = fitting.robot.body, Magnetometer(fitting.settings, fitting.seed)
    return lambda stamp_ns, _: {"mag": magnetometer.measure(stamp_ns, body.axes)}


SENSOR = SensorType(
    MagnetometerParams,
    {"mag": MagneticField},
    "mag_rate",
    fit,
    always=True,
    standard=False,
    delivery="mag",
)
