"""Parameters of the rover."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.simulation.sensors.odometry import WheelOdometryParams
from ros_visualise.simulation.sensors.wheel_speed import WheelSpeedParams
from ros_visualise.simulation.settings import RobotParams, ScenarioParams


@dataclass(frozen=True)
class HuskyParams(WheelSpeedParams, WheelOdometryParams, RobotParams):
    """Sensors of the rover."""


@dataclass(frozen=True)
class HuskyNodeParams(ScenarioParams, HuskyParams):
    """World, mission and sensors of the rover."""
