"""Parameters of the rover."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.simulation.sensors.odometry import WheelOdometryParams
from ros_visualise.simulation.settings import RobotParams, ScenarioParams


@dataclass(frozen=True)
class HuskyParams(WheelOdometryParams, RobotParams):
    """Its sensors."""


@dataclass(frozen=True)
class HuskyNodeParams(ScenarioParams, HuskyParams):
    """Its world and mission, and its sensors."""
