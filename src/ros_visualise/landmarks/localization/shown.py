"""Landmarks as messages: detections in space, markers to look at, and frames."""

from __future__ import annotations

import zlib
from collections.abc import Collection, Iterable

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
from ros_visualise.geometry import rotations
from ros_visualise.landmarks.localization.localizer import ELLIPSOID
from ros_visualise.landmarks.localization.track import Track

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
_UNKNOWN_M = 0.2  # drawn of what has no known size
_PLATE_M = 0.01
_SHAPES = ("covariance", "box", "axes", "label")


def to_detections(landmarks: Iterable[Track], header: Header) -> Detections3D:
    """Where landmarks are; of one that may be in two poses, both."""
    return Detections3D(tuple(map(_detection, landmarks)), header)


def to_transforms(landmarks: Iterable[Track], header: Header) -> Transforms:
    """A frame for each landmark, called as it; that of a thing without orientation is level."""
    return Transforms(
        tuple(
            TransformStamped(one.name, one.best.position_xyz, _quat(one), header)
            for one in landmarks
        )
    )


def to_markers(
    landmarks: Iterable[Track], gone: Collection[int], header: Header, anew: bool
) -> MarkerArray:
    """Shapes for landmarks.

    An ellipsoid is where each is with a probability of 95 %, a plate or box how large it is.

    Args:
        landmarks: all that there are.
        gone: numbers of those that are no more.
        header: time and fixed frame.
        anew: whether all that was drawn before is to go.
    """
    clear = (Marker(MarkerType.CUBE, action=MarkerAction.DELETEALL, header=header),) if anew else ()
    deleted = (
        Marker(MarkerType.CUBE, ns=shape, id=number, action=MarkerAction.DELETE, header=header)
        for number in gone
        for shape in _SHAPES
    )
    shapes = (marker for one in landmarks for marker in _markers(one, header))
    return MarkerArray((*clear, *deleted, *shapes))


def _detection(track: Track) -> Detection3D:
    hypotheses = tuple(
        Hypothesis(
            track.class_id,
            weight,
            branch.estimate.position_xyz,
            rotations.from_matrix(branch.estimate.R_fixed_landmark),
            branch.estimate.covariance,
            track.class_number,
        )
        for weight, branch in zip(track.weights, track.branches, strict=True)
    )
    at = track.best.position_xyz
    return Detection3D(at, _quat(track), track.size_xyz, hypotheses, track.name)


def _quat(track: Track) -> Floats:
    return rotations.from_matrix(track.best.R_fixed_landmark)


def _markers(track: Track, header: Header) -> list[Marker]:
    at, quat, number = track.best.position_xyz, _quat(track), track.number
    extent = float(track.size_xyz.max()) or _UNKNOWN_M
    scale, axes = ellipsoid(track.covariance[:3, :3])
    color = np.append(_COLORS[zlib.crc32(track.class_id.encode()) % len(_COLORS)], 0.35)
    box = np.maximum(track.size_xyz, _PLATE_M) if track.sizes else np.full(3, _UNKNOWN_M / 4)
    label = at + np.array([0, 0, extent / 2 + 0.15])
    lines = np.vstack([np.zeros((3, 3)), np.eye(3) * extent])[[0, 3, 1, 4, 2, 5]]
    drawn = [
        Marker(
            MarkerType.SPHERE, at, axes, scale, color, ns="covariance", id=number, header=header
        ),
        Marker(
            MarkerType.CUBE,
            at,
            quat,
            box,
            np.append(color[:3], 0.75),
            ns="box",
            id=number,
            header=header,
        ),
        Marker(
            MarkerType.TEXT_VIEW_FACING,
            label,
            scale_xyz=np.full(3, 0.15),
            text=track.name,
            ns="label",
            id=number,
            header=header,
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
                header=header,
            )
        )
    return drawn


def ellipsoid(covariance: Floats) -> tuple[Floats, Floats]:
    """Lengths (3,) and orientation of the ellipsoid that holds 95 % of all points.

    Args:
        covariance: (3, 3), m^2.

    Returns:
        the lengths of its axes in metres, from side to side, and a quaternion (4,).
    """
    variances, axes = np.linalg.eigh(covariance)
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    lengths = 2 * np.sqrt(ELLIPSOID * np.maximum(variances, 1e-12))
    return lengths, rotations.from_matrix(axes)
