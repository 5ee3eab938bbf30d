"""Cameras: their fields of view with their images."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import CameraInfo, Image, Pixels
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.live.space.nodes import Frustum
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.preview import rgb_preview
from ros_visualise.ui.scene.drawing import Appearance, Drawing

_IMAGE_SIZE = 320
_JPEG_QUALITY = 75
_LENGTH = 0.6


class CameraDrawing(Drawing):
    """The frustum of an `Image` or a `CameraInfo`, for calibrated cameras only."""

    draws = (CameraInfo, Image)

    def __init__(self, scene: SpaceTree, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self._frustum: Frustum | None = None

    def draw(self, message: Any, appearance: Appearance) -> None:
        info = message if isinstance(message, CameraInfo) else message.camera_info
        view = None if info is None else view_of(info)
        if view is None:
            return
        fov, aspect = view
        if self._frustum is None:
            self._frustum = self._scene.add(f"{self._name}/camera", Frustum(color=self._color))
        self._frustum.fov, self._frustum.aspect = fov, aspect
        self._frustum.length = _LENGTH * appearance.axes_size
        if isinstance(message, Image):
            self._frustum.image = jpeg(rgb_preview(message, _IMAGE_SIZE))

    def extent(self) -> npt.NDArray[np.floating]:
        return np.zeros((0, 3))


def jpeg(rgb: Pixels) -> bytes:
    """An image, encoded."""
    bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()


def view_of(info: CameraInfo) -> tuple[float, float] | None:
    """A camera's vertical field of view in radians, and its width over height; None if unknown."""
    fx, fy = info.K[0, 0], info.K[1, 1]
    if not (0 < fx < math.inf and 0 < fy < math.inf and info.width and info.height):
        return None
    fov = 2 * math.atan(info.height / 2 / fy)
    return fov, (info.width / fx) / (info.height / fy)
