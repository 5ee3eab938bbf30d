"""Settings of the navigator, in the units of its filter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.imu import ACCEL, GYRO, ImuNoise
from ros_visualise.estimation.landmark_map import MapMode, MapRules
from ros_visualise.estimation.measuring import CAMERAS, CLOCK, FOCAL, TURN, turn_of
from ros_visualise.estimation.odometry import AXES, SCALES, OdometryNoise
from ros_visualise.estimation.robot import GRAVITY, GRAVITY_MS2, core
from ros_visualise.estimation.sensors import SENSORS, Prior
from ros_visualise.estimation.state import State
from ros_visualise.estimation.steadiness import loosened
from ros_visualise.estimation.updating import GROUND

CAMERA_TURN = 1.5
"""Standard deviation of the camera's attitude, degrees, if none is stated. The error is estimated,
so too large a value costs little, but too small a value makes the pose overconfident.
"""
_CLOCK_WALK = 1e-4  # s per sqrt(s)


@dataclass(frozen=True)
class CameraErrors:
    """Standard deviations of errors that are estimated with the robot; 0: not estimated.

    Attributes:
        clock_s: of the camera's clock.
        turn_rad: of its attitude on the robot.
        turn_s: time constant with which that changes, as on a gimbal; 0: it is constant.
        focal: of its focal length, as a fraction.
    """

    clock_s: float = 0.05
    turn_rad: float = 0.0
    turn_s: float = 20.0
    focal: float = 0.0

    def at_level(self, level: float) -> CameraErrors:
        """The same for a camera less steady than stated, see `estimation.steadiness`."""
        turn_rad, turn_s = loosened(self.turn_rad, self.turn_s, level)
        return replace(self, turn_rad=turn_rad, turn_s=turn_s)

    @property
    def variances(self) -> Floats:
        """(5,) variances of a camera's states."""
        sigmas = np.zeros(5)
        sigmas[CLOCK], sigmas[TURN], sigmas[FOCAL] = self.clock_s, self.turn_rad, self.focal
        return sigmas**2


@dataclass(frozen=True)
class NavigatorSettings:
    """Settings of the navigator.

    Attributes:
        rules: of the landmarks.
        odometry, imu, camera: errors of these.
        has_imu: use the IMU if there is one.
        level_rad: standard deviation of the tilt of the odometry's frame.
        delay_s: age up to which a measurement counts.
        fastest: largest speed, m/s; faster odometry has jumped.
        sensors: parameters of all other sensors, by name.
    """

    rules: MapRules = field(default_factory=MapRules)
    odometry: OdometryNoise = field(default_factory=OdometryNoise)
    imu: ImuNoise = field(default_factory=ImuNoise)
    camera: CameraErrors = field(default_factory=CameraErrors)
    has_imu: bool = True
    level_rad: float = np.radians(0.5)
    delay_s: float = 0.5
    fastest: float = 30.0
    sensors: Mapping[str, Any] = field(default_factory=dict)

    def sensor(self, name: str) -> Any:
        """The parameters of a sensor."""
        return self.sensors[name] if name in self.sensors else SENSORS.find(name).params()

    def unknown(self) -> State:
        """The state before any measurement."""
        variances = np.zeros(core())
        for rows, variance in self.priors():
            variances[rows] = variance
        return State(P=np.diag(variances))

    def priors(self) -> Iterator[tuple[slice, Floats]]:
        """Rows of errors that are estimated, and their variances in the beginning.

        A new map is level by definition; a given one has an unknown tilt within ``level_rad``.
        """
        imu, plane = self.imu, self.rules.plane
        yield SCALES.rows, np.diag(self.odometry.scales)
        yield AXES.rows, np.full(3, self.odometry.axes**2)
        yield GYRO.rows, np.full(3, imu.gyro_bias**2)
        yield ACCEL.rows, np.full(3, imu.accel_bias**2)
        yield GROUND.rows, np.full(1, plane.sigma_m**2 if plane else 0.0)
        for camera in CAMERAS:
            yield camera.rows, self.camera.variances
        for sensor in SENSORS.all():
            for states, prior in sensor.states(self.sensor(sensor.name)).items():
                count = states.rows.stop - states.rows.start
                yield states.rows, np.full(count, prior.sigma**2)
        if self.rules.mode is not MapMode.BUILD:
            yield GRAVITY, np.full(2, (GRAVITY_MS2 * self.level_rad) ** 2)

    def aging(self, seconds: float, levels: Sequence[float]) -> tuple[Floats, Floats]:
        """Factors (n,) on the sensors' states, and variances (n,) added, over some time.

        ``levels`` are those of the cameras, see `CameraErrors.at_level`.
        """
        keep, noise = np.ones(core()), np.zeros(core())
        for camera, level in enumerate(levels):
            errors = self.camera.at_level(level)
            noise[CAMERAS[camera].rows.start + CLOCK] = (
                (errors.clock_s > 0) * _CLOCK_WALK**2 * seconds
            )
            wander = Prior(errors.turn_rad, time_s=errors.turn_s or None).over(seconds)
            keep[turn_of(camera)], noise[turn_of(camera)] = wander
        for sensor in SENSORS.all():
            for states, prior in sensor.states(self.sensor(sensor.name)).items():
                keep[states.rows], noise[states.rows] = prior.over(seconds)
        return keep, noise
