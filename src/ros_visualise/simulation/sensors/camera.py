"""A pinhole camera."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import CameraInfo, Floats, Header, Image, Pixels
from ros_visualise.simulation.delivery import delivered
from ros_visualise.simulation.noise import random_of
from ros_visualise.simulation.rendering import Renderer
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting

_NOISE_MARGIN = 64

_camera = partial(setting, group="camera")


@delivered("camera", "camera")
@dataclass(frozen=True)
class CameraSensorParams:
    """Parameters of a camera."""

    camera: bool = _camera(True, "switch the camera on")
    camera_rate: float = _camera(10.0, "images per second", min=0.1, max=60)
    camera_width: int = _camera(640, "width of the images, pixels", min=16, max=4096)
    camera_height: int = _camera(480, "height of the images, pixels", min=16, max=4096)
    camera_fov: float = _camera(80.0, "horizontal field of view, degrees", min=10, max=150)
    camera_pitch: float = _camera(
        0.0, "pitch of the camera: 0 ahead, 90 straight down, degrees", min=-90, max=90
    )
    camera_noise: float = _camera(
        2.0, "noise of each pixel (standard deviation), levels of 255", min=0, max=50
    )


def calibrate(params: CameraSensorParams) -> CameraInfo:
    """The camera's calibration: no distortion, the principal point in the image centre."""
    width, height = params.camera_width, params.camera_height
    focal = width / 2 / math.tan(math.radians(params.camera_fov) / 2)
    K = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
    return CameraInfo(height, width, K, P=np.hstack([K, np.zeros((3, 1))]))


def vertical_fov(params: CameraSensorParams) -> float:
    """Vertical field of view, degrees."""
    half = math.tan(math.radians(params.camera_fov) / 2)
    return 2 * math.degrees(math.atan(half * params.camera_height / params.camera_width))


class CameraSensor:
    """Rendered images with noise; the renderer is created for the first one.

    The noise of an image is a random part of one large array: drawing a million numbers for each
    image would cost as much as rendering.
    """

    frame_id = "camera_optical"

    def __init__(self, params: CameraSensorParams, seed: int, model: Any) -> None:
        self._params, self._seed, self._model = params, seed, model
        self._info = calibrate(params)
        self._renderer: Renderer | None = None
        self._grain: npt.NDArray[np.int8] | None = None

    def measure(
        self, stamp_ns: int, index: int, data: Any, position_xyz: Floats, R_map_optical: Floats
    ) -> Image:
        """The image with that index from a pose in the world."""
        size = self._params.camera_width, self._params.camera_height
        if self._renderer is None:
            self._renderer = Renderer(self._model, size)
        pixels = self._renderer.render(data, position_xyz, R_map_optical)
        header = Header(stamp_ns, self.frame_id)
        info = replace(self._info, header=header)
        return Image(self._add_noise(pixels, index), "rgb8", header, info)

    def close(self) -> None:
        """Free the renderer, in the thread that took the images."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _add_noise(self, pixels: Pixels, index: int) -> Pixels:
        if not self._params.camera_noise:
            return pixels
        height, width = pixels.shape[:2]
        if self._grain is None:
            shape = (height + _NOISE_MARGIN, width + _NOISE_MARGIN, 3)
            normal = random_of(self._seed, "camera").standard_normal(shape, np.float32)
            self._grain = np.clip(np.rint(self._params.camera_noise * normal), -127, 127).astype(
                np.int8
            )
        x, y = random_of(self._seed, "camera", index + 1).integers(0, _NOISE_MARGIN, 2).tolist()
        grain = np.ascontiguousarray(self._grain[y : y + height, x : x + width])
        return np.asarray(cv2.add(pixels, grain, dtype=cv2.CV_8U))


def fit(fitting: Fitting) -> Measure:
    """The camera on its mount."""
    body, mount = fitting.robot.body, fitting.mount
    camera = CameraSensor(fitting.settings, fitting.seed, fitting.model)
    fitting.closing.append(camera.close)

    def measure(stamp_ns: int, index: int) -> Mapping[str, Any]:
        place, R = mount.optical_in_map(np.array(body.position), body.axes)
        return {"image": camera.measure(stamp_ns, index, fitting.data, place, R)}

    return measure


SENSOR = SensorType(
    CameraSensorParams, {"image": Image}, "camera_rate", fit, "camera", delivery="camera"
)
