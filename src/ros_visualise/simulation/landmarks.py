"""Landmarks of a simulated world, whose true poses are known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

CELLS = 8
"""Cells along the side of a tag of family 36h11, including its black rim."""


@dataclass(frozen=True)
class SimulatedLandmark:
    """A landmark and its pose in the frame ``map``.

    ``kind`` is ``tag`` (AprilTag 36h11), ``helipad`` or ``post``. A tag's axes are x right, y up,
    and z towards the viewer. ``size`` in metres is the side of a tag's black square, the side of a
    helipad's plate, or the height of a post.
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
    """R_map_landmark of an upright board facing ``yaw`` (rad)."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[-s, 0.0, c], [c, 0.0, s], [0.0, 1.0, 0.0]])


def lying(yaw: float) -> Floats:
    """R_map_landmark of a board on the ground with its upper edge towards ``yaw`` (rad)."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[s, c, 0.0], [-c, s, 0.0], [0.0, 0.0, 1.0]])


def tag_bits(tag_id: int) -> npt.NDArray[np.uint8]:
    """The cells of a tag of family 36h11, (8, 8): 1 is white.

    Source: Wang and Olson, AprilTag 2, 2016; upright as printed by AprilTag, while OpenCV's
    dictionary has them upside down.
    """
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    code = np.ravel(dictionary.bytesList[tag_id])[:5]  # followed by the rotated codes
    inner = np.concatenate([np.unpackbits(code[:4]), np.unpackbits(code[4:])[4:]])
    return np.pad(inner[::-1].reshape(6, 6), 1)
