"""How a landing pad moves: on a line or a circle, whatever stands on it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Any

from ros_visualise.core.errors import OpenError
from ros_visualise.core.params import param
from ros_visualise.simulation.attitude import Quat, Vector
from ros_visualise.simulation.deck import PAD, stands_on_start
from ros_visualise.simulation.model import Pose2
from ros_visualise.simulation.sensors import setting

_CLEAR_S, _OFTEN_S = 2.0, 0.1  # until the robot has taken off
_ACCELERATION = 0.5  # m/s^2, where its line begins and ends

_pad = partial(setting, group="pad")

Motion = tuple[float, float, float, float]
"""Metres ahead and to the left of where it was at first, and both speeds in m/s."""


class PadMotion(Enum):
    """How a landing pad moves."""

    STILL = "still"
    LINE = "line"
    CIRCLE = "circle"


@dataclass(frozen=True)
class PadParams:
    """Parameters of a landing pad."""

    pad: bool = _pad(False, "a landing pad with tags; a mission that lands on one brings it anyway")
    pad_tags: bool = _pad(
        True, "tags on the pad; without them it is a helipad, found by landmark_detector alone"
    )
    pad_motion: PadMotion = param(
        PadMotion.STILL,
        "how the pad moves; along a line it goes back and forth",
        restart=True,
        group="pad",
    )
    pad_speed: float = _pad(1.0, "speed of the pad, where it moves, m/s", min=0.01, max=10)
    pad_reach: float = _pad(
        4.0, "length of the pad's line, or diameter of its circle, m", min=0.1, max=1000
    )
    pad_x: float = _pad(
        -3.5, "where the pad begins: east of the robot's start, m", min=-1000, max=1000
    )
    pad_y: float = _pad(
        1.5, "where the pad begins: north of the robot's start, m", min=-1000, max=1000
    )
    pad_heading: float = _pad(
        0.0,
        "direction in which the pad points, and first moves, from east, degrees",
        min=-360,
        max=360,
    )


def move(params: PadParams, time_s: float) -> Motion:
    """Where the pad is, and how fast, along the axes of its heading."""
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
    """Where the pad is at first, if there is one, and whether it has tags.

    Raises:
        OpenError: it is, or comes at once, where the robot starts.
    """
    if not (isinstance(settings, PadParams) and settings.pad):
        return None, True
    if meets_start(settings):
        raise OpenError(
            "the pad is, or comes at once, where the robot starts: choose another pad_x or pad_y"
        )
    x, y, _ = start
    yaw = math.radians(settings.pad_heading)
    return (x + settings.pad_x, y + settings.pad_y, yaw), settings.pad_tags


def meets_start(params: PadParams) -> bool:
    """Whether it stands where the robot starts, or comes there before that has taken off."""
    yaw = math.radians(params.pad_heading)
    for number in range(round(_CLEAR_S / _OFTEN_S) + 1):
        ahead, left, _, _ = move(params, number * _OFTEN_S)
        x = params.pad_x + math.cos(yaw) * ahead - math.sin(yaw) * left
        y = params.pad_y + math.sin(yaw) * ahead + math.cos(yaw) * left
        if stands_on_start((x, y, yaw)):
            return True
    return False


def _shuttle(reach: float, speed: float, time_s: float) -> tuple[float, float]:
    """Way and speed of going forth and back over a distance, from rest to rest."""
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
    """The pad in the physics, which moves it along: nothing on it holds it up.

    Args:
        model: an ``mjModel`` with a pad.
        data: its ``mjData``.
        params: how it moves.
    """

    def __init__(self, model: Any, data: Any, params: PadParams) -> None:
        self._data, self._params = data, params
        self._body = model.body(PAD).id
        joints = [model.joint(f"{PAD}_{axis}") for axis in "xy"]
        self._place = [int(joint.qposadr[0]) for joint in joints]
        self._speed = [int(joint.dofadr[0]) for joint in joints]

    def advance(self, time_s: float) -> None:
        """Put it where it is at that time, for the next step."""
        x, y, vx, vy = move(self._params, time_s)
        self._data.qpos[self._place] = x, y
        self._data.qvel[self._speed] = vx, vy

    @property
    def position(self) -> Vector:
        """The middle of its surface, metres in ``map``."""
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
