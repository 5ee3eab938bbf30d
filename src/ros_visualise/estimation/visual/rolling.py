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
        rows = (pixels[:, 1:] + 0.5) / info.height - 0.5
        pixels = pixels - moved * rows * readout_s
    rays = rays_of(pixels, info).directions
    found: Floats = rays[:, :2] / rays[:, 2:]
    return found
