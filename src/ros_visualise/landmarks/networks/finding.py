"""Candidates as detections, with names, and with bearings if known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from ros_visualise.data import CameraInfo, Detection, Floats, Hypothesis
from ros_visualise.landmarks.networks.bearings import Bearing, bearings
from ros_visualise.landmarks.networks.candidates import Candidates


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
