"""Landmarks of a simulated world, whose true poses are known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

CELLS = 8
"""Cells along the side of a tag of family 36h11, its black rim included."""


@dataclass(frozen=True)
class SimulatedLandmark:
    """A landmark and its pose in the frame ``map``.

    ``kind`` is ``tag`` (AprilTag 36h11), ``helipad`` or ``post``. Seen from the front, a tag's axes
    are x right, y up, and z towards the viewer. ``size`` in metres is the side of a tag's black
    square, the side of a helipad's plate, or the height of a post.
    """

    name: str
    kind: str
    position_xyz: tuple[float, float, float]
    R_map_landmark: Floats
    size: float
    tag_id: int = -1
    colour: str = ""

    def corners(self) -> Floats:
        """(4, 3) metres in ``map``: top left, top right, bottom right, bottom left."""
        half = self.size / 2
        square = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
        return np.asarray(square @ self.R_map_landmark.T + self.position_xyz)


def facing(yaw: float) -> Floats:
    """R_map_landmark of an upright board that faces towards ``yaw`` (rad)."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[-s, 0.0, c], [c, 0.0, s], [0.0, 1.0, 0.0]])


def lying(yaw: float) -> Floats:
    """R_map_landmark of a board on the ground whose upper edge is towards ``yaw`` (rad)."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[s, c, 0.0], [-c, s, 0.0], [0.0, 0.0, 1.0]])


def tag_bits(tag_id: int) -> npt.NDArray[np.uint8]:
    """The cells of a tag of family 36h11, (8, 8): 1 is white.

    Source: Wang and Olson, AprilTag 2, 2016; upright as AprilTag prints them. OpenCV's dictionary
    has them upside down.
    """
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    code = np.ravel(dictionary.bytesList[tag_id])[:5]  # turned by quarters, it goes on there
    inner = np.concatenate([np.unpackbits(code[:4]), np.unpackbits(code[4:])[4:]])
    return np.pad(inner[::-1].reshape(6, 6), 1)
