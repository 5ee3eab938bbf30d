"""Runs of the simulation, for its tests."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ros_visualise.data import Twist
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.simulation.robots.husky.settings import HuskyParams
from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorParams
from ros_visualise.simulation.settings import RobotParams
from ros_visualise.simulation.simulator import Simulation

BLIND_HUSKY = replace(HuskyParams(), camera=False, lidar=False)
BLIND_QUADROTOR = replace(QuadrotorParams(), camera=False)


def without_camera(robot: str) -> RobotParams:
    """The default settings of a robot, but for its camera, which takes OpenGL and time."""
    return replace(ROBOTS.find(robot).params(), camera=False)


def collect(simulation: Simulation, seconds: float) -> dict[str, list[Any]]:
    """The messages of the next seconds, by output."""
    end_ns = simulation.time_ns + round(seconds * 1e9)
    found: dict[str, list[Any]] = {}
    run = simulation.run()
    for stamp_ns, name, message in run:
        if stamp_ns >= end_ns:
            break
        found.setdefault(name, []).append(message)
    run.close()
    return found


def twist(x: float = 0, y: float = 0, z: float = 0, turn: float = 0) -> Twist:
    return Twist(np.array([x, y, z]), np.array([0.0, 0.0, turn]))
