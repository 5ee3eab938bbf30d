"""Simulated robots: a folder each, with its model, settings, control and node.

Another package adds a robot by an entry point of the group ``ros_visualise.robots``; see
`ros_visualise.core.registry`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ros_visualise.core.registry import Registry, holding

if TYPE_CHECKING:
    from ros_visualise.simulation.missions import Mission
    from ros_visualise.simulation.model import BuiltWorld
    from ros_visualise.simulation.robot import Robot
    from ros_visualise.simulation.settings import RobotParams
    from ros_visualise.simulation.source import SimulatedRobot


@dataclass(frozen=True)
class RobotType:
    """A type of robot.

    Attributes:
        source: its node, see `ros_visualise.simulation.source.simulated`.
        params: its settings.
        model: MJCF file with a body ``base_link`` that has a free joint, the sites ``camera_link``,
            ``gps_link``, ``imu_link`` and ``lidar_link``, a camera, and as its first sensors an
            accelerometer and a gyroscope.
        make: (``mjModel``, ``mjData``, settings, seed) -> the robot in its world.
        default_mission: suitable mission in a world.
    """

    source: type[SimulatedRobot]
    params: type[RobotParams]
    model: Path
    make: Callable[[Any, Any, Any, int], Robot]
    default_mission: Callable[[BuiltWorld], Mission]


ROBOTS = Registry("robots", __name__, holding(RobotType, "ROBOT"))

OURS = f"{', '.join(ROBOTS.builtin[:-1])} or {ROBOTS.builtin[-1]}"
"""The robots of this package, for a help text."""
