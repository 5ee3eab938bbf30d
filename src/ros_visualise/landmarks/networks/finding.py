"""Candidates as detections, with names, and with bearings if known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from ros_visualise.data import CameraInfo, Detection, Floats, Hypothesis
from ros_visualise.landmarks.networks.candidates import Candidates
from ros_visualise.landmarks.pose.rays import rays_of

_UNKNOWN = 1e6
"""Variance along the ray in m^2, and of the orientation in rad^2: both unknown."""
Bearing = tuple[Floats, Floats]
"""Position (3,) and its covariance (6, 6), of x, y, z and the rotations about them."""


class GroundPoint(Enum):
    """Assumed ground point of a box."""

    BOTTOM = "bottom"
    CENTER = "center"


@dataclass(frozen=True)
class GroundPointRule:
    """Ground points for networks that give only boxes.

    A box does not contain its ground point: ``place`` is assumed, with a standard deviation of
    ``share`` of its width and height.
    """

    place: GroundPoint = GroundPoint.BOTTOM
    share: float = 0.1

    def of(self, boxes_xyxy: Floats) -> tuple[Floats, Floats]:
        """The points (N, 2) of boxes (N, 4), and their covariances (N, 2, 2)."""
        size = boxes_xyxy[:, 2:] - boxes_xyxy[:, :2]
        points = boxes_xyxy[:, :2] + size / 2
        if self.place is GroundPoint.BOTTOM:
            points[:, 1] = boxes_xyxy[:, 3]
        return points, (self.share * size[:, :, None]) ** 2 * np.eye(2)


def to_detections(
    found: Candidates, names: Mapping[int, str], stand: GroundPointRule, info: CameraInfo | None
) -> tuple[Detection, ...]:
    """Each candidate as a detection with one hypothesis: class, score and, if calibrated, a
    bearing.

    Args:
        found: in pixels of an image.
        names: of the classes; unnamed ones are called by their number.
        stand: used only if the network gives no points.
        info: the image's calibration.

    Raises:
        UncalibratedCamera, UnsupportedImage: no calibration, or an unknown model.
    """
    points, covariances = found.points_uv, found.covariances
    if points is None or covariances is None:
        points, covariances = stand.of(found.boxes_xyxy)
    located = [None] * len(found) if info is None else bearings(points, covariances, info)
    whats = [
        _hypothesis(int(number), float(score), names, bearing)
        for number, score, bearing in zip(found.classes, found.scores, located, strict=True)
    ]
    return tuple(_detection(found, row, what) for row, what in enumerate(whats))


def _hypothesis(
    number: int, score: float, names: Mapping[int, str], bearing: Bearing | None
) -> Hypothesis:
    name = names.get(number, str(number))
    if bearing is None:
        return Hypothesis(name, score, number=number)
    position, covariance = bearing
    return Hypothesis(name, score, position, covariance=covariance, number=number)


def _detection(found: Candidates, row: int, what: Hypothesis) -> Detection:
    low, high = found.boxes_xyxy[row, :2], found.boxes_xyxy[row, 2:]
    box = Detection((low + high) / 2, high - low, hypotheses=(what,))
    points, covariances = found.points_uv, found.covariances
    if points is None or covariances is None:
        return box
    return replace(box, point_uv=points[row], point_covariance=covariances[row])


def bearings(points_uv: Floats, covariances: Floats, info: CameraInfo) -> list[Bearing | None]:
    """Positions at one metre in the directions of pixels.

    Readers use the direction, and the covariance across it: in square metres at one metre.

    Args:
        points_uv: (N, 2) pixels of the image, origin at the centre of the top-left one.
        covariances: (N, 2, 2) of these, square pixels.
        info: the camera's calibration.

    Returns:
        For each point its bearing in the camera's optical frame; None if the camera model has no
            ray for it.

    Raises:
        UncalibratedCamera: no calibration.
        UnsupportedImage: unknown distortion model.
    """
    rays = rays_of(points_uv, info)
    return [
        (ray, _propagated(ray, to_pixels, covariance)) if np.isfinite(ray).all() else None
        for ray, to_pixels, covariance in zip(*rays, covariances, strict=True)
    ]


def _propagated(direction: Floats, to_pixels: Floats, covariance: Floats) -> Floats:
    """The pixel's covariance propagated to the plane across the ray (first order)."""
    to_plane = np.linalg.pinv(to_pixels)
    full = np.eye(6) * _UNKNOWN
    along = np.outer(direction, direction)
    full[:3, :3] = to_plane @ covariance @ to_plane.T + _UNKNOWN * along
    return full
