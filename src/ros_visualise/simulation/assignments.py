"""Which mission a robot is given: by name, by a file, or one that suits it and its world."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ros_visualise.core.errors import OpenError
from ros_visualise.simulation.missions import SHAPES, Mission, read_mission
from ros_visualise.simulation.model import build_world
from ros_visualise.simulation.pad import PadParams
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.simulation.settings import RobotParams
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
        return ROBOTS.find(robot).default_mission(build_world(world, pictures=False))
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
    if not isinstance(settings, PadParams):
        raise OpenError("a mission with land_on is for robots that fly: take the quadrotor")
    return replace(settings, **{"pad": True})
