"""Settings of the navigator."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ros_visualise.landmarks.navigation.landmark_map import MapMode, MapRules
from ros_visualise.landmarks.navigation.robot import ACCEL, CORE, GRAVITY, GRAVITY_MS2, GYRO, SLOW
from ros_visualise.landmarks.navigation.sensor_buffer import SensorNoise
from ros_visualise.landmarks.navigation.state import FilterState


@dataclass(frozen=True)
class NavigatorSettings:
    """Settings of the navigator.

    Attributes:
        rules: of the landmarks.
        noise: errors of the robot's own sensors.
        level_rad: standard deviation of the tilt of the odometry's frame.
        delay_s: longest delay of an image.
        fastest: largest speed, m/s; faster odometry has jumped.
    """

    rules: MapRules = field(default_factory=MapRules)
    noise: SensorNoise = field(default_factory=SensorNoise)
    level_rad: float = np.radians(0.5)
    delay_s: float = 0.5
    fastest: float = 30.0

    def unknown(self) -> FilterState:
        """The state before any measurement.

        A new map is level by definition; a given one has an unknown tilt within ``level_rad``.
        """
        state, P, eye = FilterState(), np.zeros((CORE, CORE)), np.eye(3)
        P[GYRO, GYRO] = self.noise.imu.gyro_bias**2 * eye
        P[ACCEL, ACCEL] = self.noise.imu.accel_bias**2 * eye
        P[SLOW, SLOW] = eye
        if self.rules.mode is not MapMode.BUILD:
            P[GRAVITY, GRAVITY] = (GRAVITY_MS2 * self.level_rad) ** 2 * np.eye(2)
        state.covariance = P
        return state
