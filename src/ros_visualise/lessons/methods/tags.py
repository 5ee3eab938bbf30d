"""A tag in a picture: detected, or drawn into it."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from ros_visualise.data import CameraInfo, Floats, Pixels
from ros_visualise.geometry import rotations
from ros_visualise.landmarks.tags import TagFinder, parse_families
from ros_visualise.landmarks.tags.patterns import draw_cells
from ros_visualise.lessons.methods.camera import project
from ros_visualise.lessons.methods.homography import homography

_FAMILY = parse_families("tag36h11")[0]
SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
"""Corners of the tag's square, x right and y up, in sides: lower left, then anticlockwise."""


@dataclass(frozen=True, eq=False)
class TagSeen:
    """A tag in a picture; ``truth`` (4, 2) are its corners if it was drawn."""

    picture: Pixels
    info: CameraInfo
    size_m: float
    truth: Floats | None
    name: str = ""
    corners: Floats = field(default_factory=lambda: np.zeros((0, 2)))


def find_tag(seen: TagSeen) -> TagSeen | None:
    """The picture with its largest tag; None without a tag."""
    gray = cv2.cvtColor(seen.picture, cv2.COLOR_BGR2GRAY)
    tags = TagFinder([_FAMILY]).find(gray)
    if not tags:
        return None
    largest = max(tags, key=lambda one: cv2.contourArea(one.corners_uv.astype(np.float32)))
    return TagSeen(
        seen.picture, seen.info, seen.size_m, seen.truth, largest.name, largest.corners_uv
    )


def draw_tag(
    bgr: Pixels, info: CameraInfo, size_m: float, distance_m: float, turned_rad: Floats
) -> TagSeen:
    """The picture with a tag in front of the camera.

    Args:
        bgr: the picture.
        info: its camera.
        size_m: side of the tag's black square.
        distance_m: of the tag's centre.
        turned_rad: rotation from facing the camera: backwards, sideways, around the axis.
    """
    cells, rim = draw_cells(_FAMILY, 7)
    outer = 1 + 2 * rim / (len(cells) - 2 * rim)  # of the white rim, in sides
    turn = rotations.to_matrix(rotations.from_rpy(turned_rad))
    R = turn @ np.diag([1.0, -1, -1])
    plane_points = np.column_stack([SQUARE, np.zeros(4)]) * size_m
    truth = project(plane_points @ R.T + [0, 0, distance_m], info.K)
    H = homography(SQUARE, truth)
    pixel = outer / len(cells)
    to_plane = np.array(
        [[pixel, 0, (pixel - outer) / 2], [0, -pixel, (outer - pixel) / 2], [0, 0, 1]]
    )
    times = 4  # supersampling along each side
    finer = np.array([[times, 0, (times - 1) / 2], [0, times, (times - 1) / 2], [0, 0, 1]])
    size = (info.width * times, info.height * times)
    drawn, share = (
        cv2.resize(
            cv2.warpPerspective(one, finer @ H @ to_plane, size, flags=cv2.INTER_NEAREST),
            (info.width, info.height),
            interpolation=cv2.INTER_AREA,
        )
        for one in (cells * np.uint8(215) + np.uint8(20), np.full(cells.shape, 1.0))
    )
    mixed = bgr * (1 - share[..., None]) + drawn[..., None]
    return TagSeen(mixed.clip(0, 255).astype(np.uint8), info, size_m, truth)
