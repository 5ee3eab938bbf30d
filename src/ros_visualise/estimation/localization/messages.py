"""Landmarks as messages: 3D detections, markers, and frames."""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ros_visualise.data import (
    Detection3D,
    Detections3D,
    Floats,
    Header,
    Hypothesis,
    Marker,
    MarkerArray,
    Transforms,
    TransformStamped,
)
from ros_visualise.data.markers import MarkerAction, MarkerType
from ros_visualise.estimation.localization.estimate import POSE
from ros_visualise.estimation.localization.localizer import ELLIPSOID
from ros_visualise.estimation.localization.track import LandmarkTrack
from ros_visualise.geometry import rotations

_COLORS = np.array(
    [
        [0.90, 0.62, 0.0],
        [0.34, 0.71, 0.91],
        [0.0, 0.62, 0.45],
        [0.94, 0.89, 0.26],
        [0.8, 0.47, 0.65],
    ]
)
_AXES = np.repeat(np.hstack([np.eye(3), np.ones((3, 1))]), 2, axis=0).astype(np.float32)
_UNKNOWN_M = 0.2  # drawn size of objects of unknown size
_PLATE_M = 0.01
_LABEL_M = 0.15  # smallest height of labels
_SHAPES = ("covariance", "box", "axes", "label")


class _LandmarkDrawing(NamedTuple):
    """One landmark in all messages, without their time."""

    known: tuple[int, int]
    detection: Detection3D
    frame: TransformStamped
    markers: tuple[Marker, ...]


class LandmarkMessages:
    """Makes messages of landmarks, reusing those of unchanged landmarks."""

    def __init__(self) -> None:
        self._drawn: dict[int, _LandmarkDrawing] = {}
        self._is_new = True

    def detections(self, landmarks: Iterable[LandmarkTrack], header: Header) -> Detections3D:
        """The landmarks as detections; an undecided one has both poses."""
        return Detections3D(tuple(self._draw(one).detection for one in landmarks), header)

    def transforms(self, landmarks: Iterable[LandmarkTrack], header: Header) -> Transforms:
        """A frame for each landmark, named after it; level if it has no orientation."""
        frames = (self._draw(one).frame for one in landmarks)
        return Transforms(tuple(replace(frame, header=header) for frame in frames))

    def markers(self, landmarks: Iterable[LandmarkTrack], header: Header) -> MarkerArray:
        """Shapes for landmarks; those of removed landmarks are deleted.

        The ellipsoid contains the landmark with a probability of 95 %; the plate or box shows its
        size. The first message deletes all earlier markers of that topic.
        """
        there = {one.number: self._draw(one).markers for one in landmarks}
        first = [Marker(MarkerType.CUBE, action=MarkerAction.DELETEALL)] if self._is_new else []
        gone = [
            Marker(MarkerType.CUBE, ns=shape, id=number, action=MarkerAction.DELETE)
            for number in self._drawn.keys() - there.keys()
            for shape in _SHAPES
        ]
        self._is_new = False
        self._drawn = {number: self._drawn[number] for number in there}
        several = (*first, *gone, *(marker for one in there.values() for marker in one))
        return MarkerArray(tuple(replace(marker, header=header) for marker in several))

    def _draw(self, track: LandmarkTrack) -> _LandmarkDrawing:
        known, drawn = (track.seen, track.last_ns), self._drawn.get(track.number)
        if drawn is None or drawn.known != known:
            at, quat = track.best.position_xyz, rotations.from_matrix(track.best.R_fixed_landmark)
            frame = TransformStamped(track.name, at, quat)
            drawn = _LandmarkDrawing(known, _detection(track, quat), frame, _markers(track, quat))
            self._drawn[track.number] = drawn
        return drawn


def _detection(track: LandmarkTrack, quat: Floats) -> Detection3D:
    hypotheses = tuple(
        Hypothesis(
            track.class_id,
            weight,
            branch.estimate.position_xyz,
            rotations.from_matrix(branch.estimate.R_fixed_landmark),
            branch.estimate.covariance[POSE, POSE],
            track.class_number,
        )
        for weight, branch in zip(track.weights, track.branches, strict=True)
    )
    at = track.best.position_xyz
    return Detection3D(at, quat, track.size_xyz, hypotheses, track.name)


def _markers(track: LandmarkTrack, quat: Floats) -> tuple[Marker, ...]:
    at, number = track.best.position_xyz, track.number
    extent = float(track.size_xyz.max()) or _UNKNOWN_M
    scale, axes = ellipsoid(track.covariance[:3, :3])
    color = np.append(_COLORS[zlib.crc32(track.class_id.encode()) % len(_COLORS)], 0.35)
    box = np.maximum(track.size_xyz, _PLATE_M) if track.sizes else np.full(3, _UNKNOWN_M / 4)
    tall = max(extent / 3, _LABEL_M)
    label = at + np.array([0, 0, extent / 2 + tall])
    lines = np.vstack([np.zeros((3, 3)), np.eye(3) * extent])[[0, 3, 1, 4, 2, 5]]
    drawn = [
        Marker(MarkerType.SPHERE, at, axes, scale, color, ns="covariance", id=number),
        Marker(MarkerType.CUBE, at, quat, box, np.append(color[:3], 0.75), ns="box", id=number),
        Marker(
            MarkerType.TEXT_VIEW_FACING,
            label,
            scale_xyz=np.full(3, tall),
            text=track.name,
            ns="label",
            id=number,
        ),
    ]
    if track.turned:
        drawn.append(
            Marker(
                MarkerType.LINE_LIST,
                at,
                quat,
                np.array([extent / 25, 0, 0]),
                points_xyz=lines,
                colors_rgba=_AXES,
                ns="axes",
                id=number,
            )
        )
    return tuple(drawn)


def ellipsoid(covariance: Floats) -> tuple[Floats, Floats]:
    """Lengths and orientations of ellipsoids that contain 95 % of a distribution.

    Args:
        covariance: (..., 3, 3), m^2.

    Returns:
        full lengths (..., 3) of their axes in metres, and quaternions (..., 4).
    """
    variances, axes = np.linalg.eigh(covariance)
    axes[..., 0] *= np.sign(np.linalg.det(axes))[..., None]
    lengths = 2 * np.sqrt(ELLIPSOID * np.maximum(variances, 1e-12))
    return lengths, rotations.from_matrix(axes)
