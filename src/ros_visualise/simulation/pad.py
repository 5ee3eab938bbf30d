"""A landing pad with a helipad and tags, standing or moving along a line or a circle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Any

import numpy as np

from ros_visualise.core.errors import OpenError
from ros_visualise.core.params import param
from ros_visualise.simulation.attitude import Quat, Vector
from ros_visualise.simulation.mjcf import PRINT_THICKNESS, SHOWN, Pose2, WorldBuilder
from ros_visualise.simulation.sensors import setting
from ros_visualise.simulation.textures import draw_helipad

_CLEAR_S, _OFTEN_S = 2.0, 0.1  # take-off time of the robot, and checks during it
_ACCELERATION = 0.5  # m/s^2, at the ends of its line

_pad = partial(setting, group="pad")

Motion = tuple[float, float, float, float]
"""Metres ahead and to the left of its start, and both speeds in m/s."""
PAD = "pad"
PAD_TOP_M = 0.3
"""Height of the pad above the ground."""
_HALF_M = 0.6  # of the helipad
_AHEAD_M = 0.8  # of the deck in front of the helipad, for the large tag
_THICKNESS_M = 0.05
_ROBOT_M = 0.4  # radius
PAD_TAGS = ((100, 0.64, (1.0, 0.0)), (101, 0.096, (0.0, 0.0)), (102, 0.05, (0.1, 0.0)))
"""Id, side of the black square, and position on the pad, of its tags."""
_JOINTS = (
    '<inertial pos="0 0 0" mass="500" diaginertia="100 100 100"/>'
    f'<joint name="{PAD}_x" type="slide" axis="1 0 0"/>'
    f'<joint name="{PAD}_y" type="slide" axis="0 1 0"/>'
)


class PadMotion(Enum):
    """Motion of a landing pad."""

    STILL = "still"
    LINE = "line"
    CIRCLE = "circle"


@dataclass(frozen=True)
class PadParams:
    """Parameters of a landing pad."""

    pad: bool = _pad(False, "add a landing pad; added automatically for missions that land on it")
    pad_tags: bool = _pad(
        True, "tags on the pad; without them only landmark_detector finds the helipad"
    )
    pad_motion: PadMotion = param(
        PadMotion.STILL,
        "motion of the pad; on a line it moves back and forth",
        restart=True,
        group="pad",
    )
    pad_speed: float = _pad(1.0, "speed of a moving pad, m/s", min=0.01, max=10)
    pad_reach: float = _pad(
        4.0, "length of the pad's line or diameter of its circle, m", min=0.1, max=1000
    )
    pad_x: float = _pad(
        -3.5, "initial position of the pad, east of the robot's start, m", min=-1000, max=1000
    )
    pad_y: float = _pad(
        1.5, "initial position of the pad, north of the robot's start, m", min=-1000, max=1000
    )
    pad_heading: float = _pad(
        0.0,
        "heading of the pad and its initial direction of motion, degrees from east",
        min=-360,
        max=360,
    )


def move(params: PadParams, time_s: float) -> Motion:
    """Position and velocity of the pad, along the axes of its heading."""
    if params.pad_motion is PadMotion.LINE:
        way, speed = _shuttle(params.pad_reach, params.pad_speed, time_s)
        return way, 0.0, speed, 0.0
    if params.pad_motion is PadMotion.CIRCLE:
        radius, speed = params.pad_reach / 2, params.pad_speed
        turn = speed * time_s / radius
        c, s = math.cos(turn), math.sin(turn)
        return radius * s, radius * (1 - c), speed * c, speed * s
    return 0.0, 0.0, 0.0, 0.0


def place_pad(settings: Any, start: Pose2) -> tuple[Pose2 | None, bool]:
    """Initial pose of the pad, or None, and True if it has tags.

    Raises:
        OpenError: it would collide with the robot at the start.
    """
    if not (isinstance(settings, PadParams) and settings.pad):
        return None, True
    if meets_start(settings):
        raise OpenError(
            "the pad collides with the robot at its start: choose another pad_x or pad_y"
        )
    x, y, _ = start
    yaw = math.radians(settings.pad_heading)
    return (x + settings.pad_x, y + settings.pad_y, yaw), settings.pad_tags


def meets_start(params: PadParams) -> bool:
    """True if the pad collides with the robot before that has taken off."""
    yaw = math.radians(params.pad_heading)
    for number in range(round(_CLEAR_S / _OFTEN_S) + 1):
        ahead, left, _, _ = move(params, number * _OFTEN_S)
        x = params.pad_x + math.cos(yaw) * ahead - math.sin(yaw) * left
        y = params.pad_y + math.sin(yaw) * ahead + math.cos(yaw) * left
        if stands_on_start((x, y, yaw)):
            return True
    return False


def _shuttle(reach: float, speed: float, time_s: float) -> tuple[float, float]:
    """Position and speed when going back and forth over a distance, from rest to rest."""
    top = min(speed, math.sqrt(reach * _ACCELERATION))
    rising_s = top / _ACCELERATION
    leg_s = reach / top + rising_s
    leg, since_s = divmod(time_s, leg_s)
    left_s = leg_s - since_s
    if since_s < rising_s:
        way, now = _ACCELERATION * since_s**2 / 2, _ACCELERATION * since_s
    elif left_s < rising_s:
        way, now = reach - _ACCELERATION * left_s**2 / 2, _ACCELERATION * left_s
    else:
        way, now = top * (since_s - rising_s / 2), top
    return (way, now) if leg % 2 == 0 else (reach - way, -now)


class Pad:
    """The pad in the physics, where it moves regardless of obstacles.

    Args:
        model: an ``mjModel`` with a pad.
        data: its ``mjData``.
        params: its motion.
    """

    def __init__(self, model: Any, data: Any, params: PadParams) -> None:
        self._data, self._params = data, params
        self._body = model.body(PAD).id
        joints = [model.joint(f"{PAD}_{axis}") for axis in "xy"]
        self._place = [int(joint.qposadr[0]) for joint in joints]
        self._speed = [int(joint.dofadr[0]) for joint in joints]

    def advance(self, time_s: float) -> None:
        """Set its position at that time, for the next step."""
        x, y, vx, vy = move(self._params, time_s)
        self._data.qpos[self._place] = x, y
        self._data.qvel[self._speed] = vx, vy

    @property
    def position(self) -> Vector:
        """Centre of its surface, metres in ``map``."""
        x, y, z = self._data.xpos[self._body].tolist()
        return x, y, z

    @property
    def attitude(self) -> Quat:
        """R_map_pad."""
        w, x, y, z = self._data.xquat[self._body].tolist()
        return w, x, y, z

    def velocity(self, time_s: float) -> Vector:
        """m/s in the axes of the pad, at the time of `position`."""
        _, _, vx, vy = move(self._params, time_s)
        return vx, vy, 0.0


def stands_on_start(place: tuple[float, float, float]) -> bool:
    """True if a pad at that place, relative to the robot's start, would collide with the robot."""
    x, y, yaw = place
    c, s = math.cos(yaw), math.sin(yaw)
    ahead, left = -(c * x + s * y), s * x - c * y
    is_along = -_HALF_M - _ROBOT_M < ahead < _HALF_M + _AHEAD_M + _ROBOT_M
    return is_along and abs(left) < _HALF_M + _ROBOT_M


def add_pad(scene: WorldBuilder, place: tuple[float, float, float], has_tags: bool) -> None:
    """Add the pad, at x and y in metres with a yaw in radians.

    The origin of its body is the centre of the helipad, on its surface; x points to the large tag,
    z up. The smallest tag is below the camera of a quadrotor in the centre.
    """
    x, y, yaw = place
    level = np.eye(3)
    with scene.body(PAD, (x, y, PAD_TOP_M), yaw, _JOINTS):
        bottom = -2 * PRINT_THICKNESS - _THICKNESS_M / 2
        deck = (_HALF_M + _AHEAD_M / 2, _HALF_M, _THICKNESS_M / 2)
        scene.add("box", deck, (_AHEAD_M / 2, 0, bottom), "0.34 0.36 0.38")
        cart = (0.8 * deck[0], 0.7 * _HALF_M, 0.08)
        scene.add("box", cart, (_AHEAD_M / 2, 0, -0.15), "0.2 0.22 0.25")
        helipad = scene.add_material("pad_helipad", draw_helipad)
        half = PRINT_THICKNESS / 2
        scene.add("box", (_HALF_M, _HALF_M, half), (0, 0, -3 * half), helipad, SHOWN)
        for tag_id, size, (tag_x, tag_y) in PAD_TAGS if has_tags else ():
            scene.print_tag(tag_id, (tag_x, tag_y, 0.0), level, size)
