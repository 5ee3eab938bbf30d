"""A skid-steered rover, modelled after Clearpath's Husky."""

from __future__ import annotations

from pathlib import Path

from ros_visualise.simulation.missions import Mission, follow_path
from ros_visualise.simulation.model import BuiltWorld
from ros_visualise.simulation.robots import RobotType
from ros_visualise.simulation.robots.husky.control import Husky
from ros_visualise.simulation.robots.husky.settings import HuskyNodeParams, HuskyParams
from ros_visualise.simulation.source import SimulatedRobot, simulated
from ros_visualise.sources.playback import Playback


@simulated("husky", HuskyNodeParams, ("linear.x", "angular.z"))
class HuskySource(SimulatedRobot):
    """A simulated skid-steered rover, a Husky."""

    def __init__(self, params: HuskyNodeParams, playback: Playback) -> None:
        super().__init__("husky", params, params, playback)


def default_mission(world: BuiltWorld) -> Mission:
    """Along the world's path, or around a square."""
    if world.path_xy:
        return follow_path(world.path_xy, 0.8)
    return Mission("square", center=(4.0, 0.0), speed=0.8, laps=0)


ROBOT = RobotType(
    HuskySource, HuskyParams, Path(__file__).with_name("husky.xml"), Husky, default_mission
)
