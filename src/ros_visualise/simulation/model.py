"""A world and a robot in it as one MuJoCo model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.simulation.engine import load_mujoco
from ros_visualise.simulation.landmarks import SimulatedLandmark
from ros_visualise.simulation.mjcf import Canvas, Pose2, WorldBuilder, fill_textures
from ros_visualise.simulation.pad import add_pad
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.simulation.sensors.camera import CameraSensorParams, ideal_camera
from ros_visualise.simulation.wear import Wear
from ros_visualise.simulation.worlds import WORLDS

BASE = "base_link"
_NEW = Wear()


@dataclass(frozen=True)
class BuiltWorld:
    """A world; ``starts`` are those of robots, ``path_xy`` is a closed path.

    ``landmarks`` are the static ones, without a landing pad.
    """

    name: str
    mjcf: str
    textures: dict[str, Canvas]
    landmarks: tuple[SimulatedLandmark, ...]
    starts: dict[str, Pose2]
    path_xy: tuple[tuple[float, float], ...]

    def landmark(self, name: str) -> SimulatedLandmark | None:
        """The landmark of that name, or None."""
        return next((each for each in self.landmarks if each.name == name), None)

    def start(self, robot: str) -> Pose2:
        """Start of a robot, by default the origin."""
        return self.starts.get(robot, (0.0, 0.0, 0.0))


@cache
def build_world(
    name: str,
    pictures: bool = True,
    pad: Pose2 | None = None,
    pad_tags: bool = True,
    wear: Wear = _NEW,
) -> BuiltWorld:
    """The world of that name.

    Args:
        name: one of `WORLDS`.
        pictures: draw the textures; otherwise it is gray, and ready much sooner.
        pad: initial pose of a landing pad; None for no pad.
        pad_tags: put tags on it.
        wear: of its tags, and clutter.

    Raises:
        UsageError: no such world.
    """
    scene = _new_scene(name, pictures).worn(wear.soil)
    wear.apply(scene)
    textures, landmarks = scene.textures, tuple(scene.landmarks)
    if pad is not None:
        add_pad(scene, pad, pad_tags)
    return BuiltWorld(name, scene.mjcf(), textures, landmarks, scene.starts, tuple(scene.path_xy))


@cache
def _new_scene(name: str, pictures: bool) -> WorldBuilder:
    scene = WorldBuilder(pictures)
    WORLDS.find(name).build(scene)
    return scene


def compile_model(robot: str, world: BuiltWorld, params: CameraSensorParams) -> Any:
    """The ``mjModel`` of a robot in a world; raises OpenError for an impossible lens."""
    mujoco = load_mujoco()
    name = f"{robot}.xml"
    assets = {name: ROBOTS.find(robot).model.read_bytes()}
    xml = f'<mujoco model="{robot}"><include file="{name}"/>{world.mjcf}</mujoco>'
    model = mujoco.MjModel.from_xml_string(xml, assets)
    fill_textures(model, world.textures)
    (width, height), fovy = ideal_camera(params)
    model.cam_fovy[0] = fovy
    model.vis.global_.offwidth = width
    model.vis.global_.offheight = height
    return model


def bodies_of_robot(model: Any) -> list[int]:
    """Ids of the robot's bodies, its base first."""
    base = model.body(BASE).id
    return [number for number in range(model.nbody) if model.body_rootid[number] == base]


def site_position(model: Any, name: str) -> Floats:
    """(3,) metres in the frame of the site's body."""
    return np.array(model.site(name).pos)


def standing_height(model: Any) -> float:
    """Height of ``base_link`` above the ground, metres."""
    return float(model.body(BASE).pos[2])
