"""How exactly the corners of a square tag are found."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

REAL_CAMERA_PX = 0.3
"""A floor for real cameras, whose lenses, prints and motion keep to no model that exactly."""

_SIDES_PX = (20.0, 30.0, 50.0)
_SIGMAS_PX = (0.17, 0.10, 0.05, 0.016)


def corner_sigma(corners_uv: npt.ArrayLike, floor_px: float = REAL_CAMERA_PX) -> Floats:
    """Standard deviations, in pixels, of each coordinate of squares' corners.

    Args:
        corners_uv: (..., 4, 2) pixels, in order around the square.
        floor_px: the least that is answered; 0 for rendered images.

    Returns:
        (...) by the shortest side, as measured on rendered tags of AprilTag 3 at full resolution.
    """
    corners = np.asarray(corners_uv, np.float64)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=-2), axis=-1)
    by_size = np.array(_SIGMAS_PX)[np.digitize(sides.min(axis=-1), _SIDES_PX)]
    sigma: Floats = np.hypot(by_size, floor_px)
    return sigma
