"""How the navigator works."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ros_visualise.landmarks.navigation.landmark_map import MapMode, MapRules
from ros_visualise.landmarks.navigation.robot import (
    ACCEL,
    CORE,
    GRAVITY,
    GRAVITY_MS2,
    GYRO,
    SLOW,
)
from ros_visualise.landmarks.navigation.sensor_buffer import SensorNoise
from ros_visualise.landmarks.navigation.state import FilterState


@dataclass(frozen=True)
class NavigatorSettings:
    """How the navigator works.

    Attributes:
        rules: of the landmarks.
        noise: what the robot's own sensors do wrong.
        level_rad: standard deviation of how level the odometry's frame is.
        delay_s: so long an image may be on its way.
        fastest: m/s; an odometry that is faster has jumped.
    """

    rules: MapRules = field(default_factory=MapRules)
    noise: SensorNoise = field(default_factory=SensorNoise)
    level_rad: float = np.radians(0.5)
    delay_s: float = 0.5
    fastest: float = 30.0

    def unknown(self) -> FilterState:
        """The state before anything is known but what sensors are like.

        A map that is begun is level by definition; one that is given is as level as was said.
        """
        state, P, eye = FilterState(), np.zeros((CORE, CORE)), np.eye(3)
        P[GYRO, GYRO] = self.noise.imu.gyro_bias**2 * eye
        P[ACCEL, ACCEL] = self.noise.imu.accel_bias**2 * eye
        P[SLOW, SLOW] = eye
        if self.rules.mode is not MapMode.BUILD:
            P[GRAVITY, GRAVITY] = (GRAVITY_MS2 * self.level_rad) ** 2 * np.eye(2)
        state.covariance = P
        return state
