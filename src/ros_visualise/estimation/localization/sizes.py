"""Size of a detected object, from a calibrated image."""

from __future__ import annotations

import numpy as np

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import CameraInfo, Detection, Floats
from ros_visualise.estimation.localization.estimate import LandmarkEstimate
from ros_visualise.landmarks.pose.rays import rays_of


class SizeMeasurement:
    """Measures objects in one image.

    Args:
        info: the image's calibration; nothing is measured without one or with an unknown model.
        T_fixed_camera: (4, 4) pose of the camera.
    """

    def __init__(self, info: CameraInfo | None, T_fixed_camera: Floats) -> None:
        self._info = info
        self._R, self._camera = T_fixed_camera[:3, :3], T_fixed_camera[:3, 3]

    def size(self, detection: Detection, at: LandmarkEstimate, flat: bool) -> Floats | None:
        """(3,) metres along its axes; None if unknown.

        The outline of ``flat`` objects lies in their x-y plane. Others are assumed to stand upright
        and to be as deep as wide.
        """
        if self._info is None:
            return None
        try:
            directions = rays_of(detection.outline_uv, self._info).directions
        except RosVisualiseError:
            return None
        away = at.position_xyz - self._camera
        axes = at.R_fixed_landmark if flat else _across(away)
        rays, offset = directions @ self._R.T @ axes, away @ axes
        with np.errstate(divide="ignore", invalid="ignore"):
            points = rays * (offset[2] / rays[:, 2:]) - offset
        x, y, _ = np.ptp(points, axis=0)
        if not np.isfinite(x + y):
            return None
        return np.array([x, y, 0.0]) if flat else np.array([x, x, y])


def _across(away: Floats) -> Floats:
    """(3, 3) axes right, up, and back to the viewer."""
    back = -away / np.linalg.norm(away)
    up = np.array([0.0, 0, 1]) if abs(back[2]) < 0.99 else np.array([1.0, 0, 0])
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    return np.column_stack([right, np.cross(back, right), back])
