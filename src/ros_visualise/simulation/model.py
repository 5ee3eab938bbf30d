"""A world, and a robot in it as one MuJoCo model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.simulation.deck import add_pad
from ros_visualise.simulation.engine import load_mujoco
from ros_visualise.simulation.landmarks import SimulatedLandmark
from ros_visualise.simulation.mjcf import WorldBuilder
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.simulation.sensors.camera import CameraSensorParams, vertical_fov
from ros_visualise.simulation.worlds import WORLDS

BASE = "base_link"

Pose2 = tuple[float, float, float]
"""x and y in metres, yaw in radians."""


@dataclass(frozen=True)
class BuiltWorld:
    """One world; ``starts`` has where robots start, ``path_xy`` is a closed path.

    ``landmarks`` are those that never move, so a landing pad is none.
    """

    name: str
    mjcf: str
    assets: dict[str, bytes]
    landmarks: tuple[SimulatedLandmark, ...]
    starts: dict[str, Pose2]
    path_xy: tuple[tuple[float, float], ...]

    def landmark(self, name: str) -> SimulatedLandmark | None:
        """The landmark of that name, or None."""
        return next((each for each in self.landmarks if each.name == name), None)

    def start(self, robot: str) -> Pose2:
        """Where a robot starts; the origin, if the world does not say."""
        return self.starts.get(robot, (0.0, 0.0, 0.0))


@cache
def build_world(
    name: str, pictures: bool = True, pad: Pose2 | None = None, pad_tags: bool = True
) -> BuiltWorld:
    """The world of that name; without pictures it is gray, and ready much sooner.

    Args:
        name: one of `WORLDS`.
        pictures: draw the textures.
        pad: where a landing pad is at first; None: there is none.
        pad_tags: it has tags.

    Raises:
        UsageError: there is no such world.
    """
    scene = WorldBuilder(pictures)
    WORLDS.find(name).build(scene)
    assets, landmarks = scene.assets, tuple(scene.landmarks)
    if pad is not None:
        add_pad(scene, pad, pad_tags)
    return BuiltWorld(name, scene.mjcf(), assets, landmarks, scene.starts, tuple(scene.path_xy))


def compile_model(robot: str, world: BuiltWorld, params: CameraSensorParams) -> Any:
    """The ``mjModel`` of a robot in a world."""
    mujoco = load_mujoco()
    name = f"{robot}.xml"
    assets = {**world.assets, name: ROBOTS.find(robot).model.read_bytes()}
    xml = f'<mujoco model="{robot}"><include file="{name}"/>{world.mjcf}</mujoco>'
    model = mujoco.MjModel.from_xml_string(xml, assets)
    model.cam_fovy[0] = vertical_fov(params)
    model.vis.global_.offwidth = params.camera_width
    model.vis.global_.offheight = params.camera_height
    return model


def bodies_of_robot(model: Any) -> list[int]:
    """Numbers of the bodies that the robot consists of, its base first."""
    base = model.body(BASE).id
    return [number for number in range(model.nbody) if model.body_rootid[number] == base]


def site_position(model: Any, name: str) -> Floats:
    """(3,) metres in the frame of the body that the site is on."""
    return np.array(model.site(name).pos)


def standing_height(model: Any) -> float:
    """Height of ``base_link`` over the ground, metres."""
    return float(model.body(BASE).pos[2])
