"""Tracks drawn over their image, and as markers on the ground."""

from __future__ import annotations

import colorsys
from collections.abc import Mapping, Sequence

import cv2
import numpy as np

from ros_visualise.data import (
    CameraInfo,
    Detection,
    Floats,
    Header,
    Marker,
    MarkerArray,
    MarkerType,
    Pixels,
)
from ros_visualise.landmarks.pose.rays import rays_of
from ros_visualise.vision.color import to_bgr
from ros_visualise.vision.depth import to_8_bit

_SHAPE = (255, 255, 0)  # BGR
_GOLDEN = 0.618034
_SHOWN_NS = 500_000_000  # lifetime of markers
_FARTHEST = 100.0  # times the height of the camera

Shapes = Sequence[tuple[str, Floats, Mapping[str, int]]]
"""Name, points (N, 2) and counts of lines and zones."""


def draw_tracks(
    pixels: Pixels,
    order: str,
    found: Sequence[Detection],
    trails: Mapping[int, Floats],
    shapes: Shapes,
) -> Pixels:
    """The image as bgr8 with the boxes and ids of tracks, where they were, and counts."""
    shown = to_bgr(to_8_bit(pixels), order)
    drawn = shown.copy() if shown is pixels else shown
    thick = max(1, round(min(drawn.shape[:2]) / 400))
    for name, points, counts in shapes:
        _line(drawn, points, _SHAPE, thick, closed=len(points) > 2)
        text = f"{name}: {', '.join(f'{n} {what}' for what, n in counts.items())}"
        _write(drawn, text, points.min(axis=0), _SHAPE, thick)
    for one in found:
        color = tuple(255 * c for c in reversed(_color_of(int(one.id))))
        _line(drawn, one.outline_uv, color, thick, closed=True)
        trail = trails.get(int(one.id), np.zeros((0, 2)))
        _line(drawn, trail[np.isfinite(trail).all(axis=1)], color, thick, closed=False)
        _write(drawn, one.label, one.outline_uv.min(axis=0), color, thick)
    return drawn


def on_ground(
    points_uv: Floats, info: CameraInfo, T_fixed_camera: Floats, ground_z: float
) -> Floats:
    """Points of an image on the plane of the ground, (..., 3) in the fixed frame, z up.

    NaN above the horizon and far away.

    Args:
        points_uv: (..., 2) pixels.
        info: the camera's calibration.
        T_fixed_camera: its pose, 4x4.
        ground_z: height of the ground in the fixed frame, metres.
    """
    directions = rays_of(points_uv, info).directions @ T_fixed_camera[:3, :3].T
    height = ground_z - T_fixed_camera[2, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = height / directions[..., 2]
    reach[~((reach > 0) & (reach < _FARTHEST * abs(height)))] = np.nan
    points: Floats = T_fixed_camera[:3, 3] + reach[..., None] * directions
    return points


def ground_markers(trails: Mapping[int, Floats], size_m: float, header: Header) -> MarkerArray:
    """Tracks with their ids and where they were: id -> points (N, 3), the newest first."""
    colors = {id: np.array([*_color_of(id), 1], np.float32) for id in trails}
    places = np.array([trail[0] for trail in trails.values()]).reshape(-1, 3)
    lines = [np.repeat(trail, 2, axis=0)[1:-1] for trail in trails.values()]
    of_lines = [np.tile(colors[id], (len(line), 1)) for id, line in zip(colors, lines, strict=True)]
    return MarkerArray(
        (
            Marker(
                MarkerType.SPHERE_LIST,
                scale_xyz=np.full(3, size_m),
                points_xyz=places,
                colors_rgba=np.array([*colors.values()], np.float32).reshape(-1, 4),
                ns="tracks",
                header=header,
            ),
            Marker(
                MarkerType.LINE_LIST,
                scale_xyz=np.full(3, size_m / 4),
                points_xyz=np.concatenate([np.zeros((0, 3)), *lines]),
                colors_rgba=np.concatenate([np.zeros((0, 4), np.float32), *of_lines]),
                ns="trails",
                header=header,
            ),
            *(
                Marker(
                    MarkerType.TEXT_VIEW_FACING,
                    trail[0] + [0, 0, size_m],
                    scale_xyz=np.full(3, size_m),
                    color_rgba=colors[id],
                    text=f"#{id}",
                    ns="ids",
                    id=id,
                    lifetime_ns=_SHOWN_NS,
                    header=header,
                )
                for id, trail in trails.items()
            ),
        )
    )


def _color_of(id: int) -> tuple[float, float, float]:
    """Red, green and blue from 0 to 1, far apart for successive ids."""
    return colorsys.hsv_to_rgb(id * _GOLDEN % 1, 0.8, 1.0)


def _line(
    image: Pixels, points_uv: Floats, color: tuple[float, ...], thick: int, *, closed: bool
) -> None:
    places = [points_uv.clip(-1e4, 1e4).round().astype(np.int32)]
    cv2.polylines(image, places, closed, color, thick, cv2.LINE_AA)


def _write(
    image: Pixels, text: str, corner_uv: Floats, color: tuple[float, ...], thick: int
) -> None:
    left, top = corner_uv.clip(0, [image.shape[1] - 20, image.shape[0] - 4]).tolist()
    place = round(left), round(max(top - 4, 12))
    for shade, shift in (((0, 0, 0), thick), (color, 0)):
        at = place[0] + shift, place[1] + shift
        cv2.putText(
            image, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.45 * thick, shade, thick, cv2.LINE_AA
        )
