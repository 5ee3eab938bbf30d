"""Directions of corners in images of a rolling shutter."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import CameraInfo, Floats
from ros_visualise.landmarks.pose.rays import rays_of
from ros_visualise.vision.tracking import FollowedCorners


def directions_at_once(
    corners: FollowedCorners, info: CameraInfo, readout_s: float, seconds: float
) -> Floats:
    """(N, 2) directions of corners at z = 1, as if all rows were read with the middle one.

    Args:
        readout_s: time from the first to the last row.
        seconds: time since the image before, from where the corners have moved.
    """
    pixels = corners.pixels_uv
    if readout_s and seconds > 0:
        moved = np.nan_to_num(pixels - corners.before_uv) / seconds
        pixels = pixels - moved * _rows(pixels, info) * readout_s
    return _directions(pixels, info)


def directions_by_rows(
    corners: FollowedCorners, info: CameraInfo, seconds: float
) -> tuple[Floats, Floats]:
    """(N, 2) directions of corners at z = 1, each at the time of its row.

    Also (N, 3) their velocities, 1/s, since the image ``seconds`` before, zero where these are
    unknown, and their rows, from -1/2 at the top of the image to 1/2.
    """
    known = np.isfinite(corners.before_uv[:, 0]) & (seconds > 0)
    both = np.concatenate([corners.pixels_uv, corners.before_uv[known]])
    rays, before = np.split(_directions(both, info), [len(known)])  # at once, which is faster
    rolling = np.column_stack([np.zeros_like(rays), _rows(corners.pixels_uv, info)])
    rolling[known, :2] = (rays[known] - before) / seconds
    return rays, rolling


def _rows(pixels: Floats, info: CameraInfo) -> Floats:
    """(N, 1) rows of pixels, from -1/2 at the top of the image to 1/2."""
    rows: Floats = (pixels[:, 1:] + 0.5) / info.height - 0.5
    return rows


def _directions(pixels: Floats, info: CameraInfo) -> Floats:
    """(N, 2) directions of pixels at z = 1."""
    rays = rays_of(pixels, info).directions
    found: Floats = rays[:, :2] / rays[:, 2:]
    return found
