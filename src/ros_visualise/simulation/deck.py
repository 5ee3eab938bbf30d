"""A landing pad that may move: a deck with a helipad, and tags for far and near."""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.simulation.mjcf import PRINT_THICKNESS, SHOWN, WorldBuilder
from ros_visualise.simulation.textures import draw_helipad

PAD = "pad"
PAD_TOP_M = 0.3
"""Height of the pad over the ground."""
_HALF_M = 0.6  # of the helipad
_AHEAD_M = 0.8  # by which the deck goes on, for the large tag
_THICKNESS_M = 0.05
_ROBOT_M = 0.4  # from its middle to its outermost part
PAD_TAGS = ((100, 0.64, (1.0, 0.0)), (101, 0.096, (0.0, 0.0)), (102, 0.05, (0.1, 0.0)))
"""Number, side of the black square, and place on the pad, of its tags."""
_JOINTS = (
    '<inertial pos="0 0 0" mass="500" diaginertia="100 100 100"/>'
    f'<joint name="{PAD}_x" type="slide" axis="1 0 0"/>'
    f'<joint name="{PAD}_y" type="slide" axis="0 1 0"/>'
)


def stands_on_start(place: tuple[float, float, float]) -> bool:
    """Whether a pad at that place, from the robot's start, would stand where the robot does."""
    x, y, yaw = place
    c, s = math.cos(yaw), math.sin(yaw)
    ahead, left = -(c * x + s * y), s * x - c * y
    is_along = -_HALF_M - _ROBOT_M < ahead < _HALF_M + _AHEAD_M + _ROBOT_M
    return is_along and abs(left) < _HALF_M + _ROBOT_M


def add_pad(scene: WorldBuilder, place: tuple[float, float, float], has_tags: bool) -> None:
    """Add the pad, at x and y in metres with a yaw in radians.

    The origin of its body is in the middle of the helipad, on its surface; x goes to the large tag,
    z up. The smallest tag is below the camera of a quadrotor that stands in the middle.
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
