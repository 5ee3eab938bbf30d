"""Which mission a robot is given: by name, by a file, or one that suits it and its world."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ros_visualise.errors import OpenError
from ros_visualise.simulation.missions import SHAPES, Mission, follow_path, read_mission
from ros_visualise.simulation.model import build_world
from ros_visualise.simulation.settings import QuadrotorParams, RobotParams
from ros_visualise.simulation.worlds import WORLDS


def find_mission(mission: Mission | str | Path | None, robot: str, world: str) -> Mission | None:
    """The mission that is meant: one of `SHAPES` where the world has room, ``default``, or a file.

    Raises:
        OpenError: there is no such mission.
        UsageError: there is no such world.
    """
    if mission is None or isinstance(mission, Mission):
        return mission
    if mission == "default":
        return _default_mission(robot, world)
    declared = WORLDS.find(world)
    if mission in SHAPES:
        center, size = declared.clear_area(str(mission))
        return Mission(str(mission), size, center, laps=0)
    return read_mission(mission, declared)


def with_pad(settings: RobotParams, mission: Mission | None) -> RobotParams:
    """The settings, with a pad where the mission lands on it.

    Raises:
        OpenError: the robot does not fly.
    """
    if mission is None or not mission.land_on:
        return settings
    if not isinstance(settings, QuadrotorParams):
        raise OpenError("a mission with land_on is for robots that fly: take the quadrotor")
    return replace(settings, pad=True)


def _default_mission(robot: str, world: str) -> Mission:
    """The world's path for the rover, a survey of the middle for the quadrotor."""
    if robot == "quadrotor":
        return Mission("lawn_mower", size=(15.0, 9.0), spacing=2.4, height=4.5, speed=2.0)
    if path_xy := build_world(world, pictures=False).path_xy:
        return follow_path(path_xy, 0.8)
    return Mission("square", center=(4.0, 0.0), speed=0.8, laps=0)
