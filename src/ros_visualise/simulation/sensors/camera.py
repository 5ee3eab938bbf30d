"""A camera with a lens, a rolling shutter and an automatic exposure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import CameraInfo, Floats, Header, Image, Pixels
from ros_visualise.simulation.delivery import delivered
from ros_visualise.simulation.noise import random_of
from ros_visualise.simulation.optics import Optics, ideal_size
from ros_visualise.simulation.rendering import Renderer
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting

_NOISE_MARGIN = 64
_LONGEST = 8.0  # exposure in the dark over that in daylight
_MOST_GAIN = 16.0
_STILL = np.zeros(3)

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
        2.0, "noise of each pixel (standard deviation), levels out of 255", min=0, max=50
    )
    camera_k1: float = _camera(0.0, "radial distortion k1 of the lens", min=-1, max=1)
    camera_k2: float = _camera(0.0, "radial distortion k2 of the lens", min=-1, max=1)
    camera_k3: float = _camera(0.0, "radial distortion k3 of the lens", min=-1, max=1)
    camera_p1: float = _camera(0.0, "tangential distortion p1 of the lens", min=-0.1, max=0.1)
    camera_p2: float = _camera(0.0, "tangential distortion p2 of the lens", min=-0.1, max=0.1)
    camera_readout: float = _camera(
        0.0,
        "time from the first row to the last, seconds; 0: global shutter; the stamp is the time of"
        " the middle row",
        min=0,
        max=0.1,
    )
    camera_exposure: float = _camera(
        0.0,
        "exposure time in daylight, seconds; longer in the dark; it causes motion blur",
        min=0,
        max=0.1,
    )
    camera_light: float = _camera(
        1.0,
        "light: 1 by day, 0.01 at night; the camera adapts, and its noise grows",
        min=1e-4,
        max=1,
    )
    camera_misalignment: float = _camera(
        0.0,
        "standard deviation, about each axis, of the fixed error in the camera's orientation on"
        " tf, degrees",
        min=0,
        max=10,
    )


def calibrate(params: CameraSensorParams) -> CameraInfo:
    """The camera's calibration, with the principal point in the image centre."""
    width, height = params.camera_width, params.camera_height
    focal = width / 2 / math.tan(math.radians(params.camera_fov) / 2)
    K = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
    p = params
    D = np.array([p.camera_k1, p.camera_k2, p.camera_p1, p.camera_p2, p.camera_k3])
    return CameraInfo(height, width, K, D, P=np.hstack([K, np.zeros((3, 1))]))


def ideal_camera(params: CameraSensorParams) -> tuple[tuple[int, int], float]:
    """(width, height) and vertical field of view in degrees of the image to render."""
    info = calibrate(params)
    size = ideal_size(info, params.camera_readout > 0 or params.camera_exposure > 0)
    return size, 2 * math.degrees(math.atan(size[1] / 2 / info.K[1, 1]))


class AutoExposure(NamedTuple):
    """Settings of a camera in its light.

    Attributes:
        exposure_s: of each row.
        brightness: of the image, relative to daylight.
        noise: of each pixel (standard deviation), levels of 255; it is that of few photons.
    """

    exposure_s: float
    brightness: float
    noise: float

    @classmethod
    def of(cls, params: CameraSensorParams) -> AutoExposure:
        """Expose longer, then amplify more, as far as that goes."""
        longer = min(1 / params.camera_light, _LONGEST)
        gain = min(1 / (params.camera_light * longer), _MOST_GAIN)
        brightness = params.camera_light * longer * gain
        noise = params.camera_noise * math.sqrt(gain)
        return cls(longer * params.camera_exposure, brightness, noise)


class CameraSensor:
    """Rendered images with noise; the renderer is created for the first one.

    The noise of an image is a random part of one large array: drawing a million numbers for each
    image would cost as much as rendering.
    """

    frame_id = "camera_optical"

    def __init__(self, params: CameraSensorParams, seed: int, model: Any) -> None:
        self._params, self._seed, self._model = params, seed, model
        self._info = calibrate(params)
        self._exposure = AutoExposure.of(params)
        self._optics: Optics | None = None
        self._renderer: Renderer | None = None
        self._grain: npt.NDArray[np.int8] | None = None

    def measure(
        self,
        stamp_ns: int,
        index: int,
        data: Any,
        position_xyz: Floats,
        R_map_optical: Floats,
        motion: tuple[Floats, Floats] = (_STILL, _STILL),
    ) -> Image:
        """The image with that index from a pose in the world.

        Args:
            motion: linear and angular velocity of the camera in ``map``, (3,) each.
        """
        if self._renderer is None or self._optics is None:
            exposure_s = self._exposure.exposure_s
            self._optics = Optics(self._info, self._params.camera_readout, exposure_s)
            self._renderer = Renderer(self._model, self._optics.size)
        moves = self._optics.moves
        ideal = self._renderer.render(data, position_xyz, R_map_optical, moves)
        depth = self._renderer.inverse_depth() if moves else None
        linear, angular = (velocity @ R_map_optical for velocity in motion)
        pixels = self._optics.see(ideal, depth, (linear, angular))
        if self._exposure.brightness < 1:
            pixels = np.asarray(cv2.convertScaleAbs(pixels, alpha=self._exposure.brightness))
        header = Header(stamp_ns, self.frame_id)
        info = replace(self._info, header=header)
        return Image(self._add_noise(pixels, index), "rgb8", header, info)

    def close(self) -> None:
        """Free the renderer, in the thread that took the images."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _add_noise(self, pixels: Pixels, index: int) -> Pixels:
        if not self._exposure.noise:
            return pixels
        height, width = pixels.shape[:2]
        if self._grain is None:
            shape = (height + _NOISE_MARGIN, width + _NOISE_MARGIN, 3)
            normal = random_of(self._seed, "camera").standard_normal(shape, np.float32)
            self._grain = np.clip(np.rint(self._exposure.noise * normal), -127, 127).astype(np.int8)
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
        motion = mount.motion_in_map(body.axes, *body.velocity())
        return {"image": camera.measure(stamp_ns, index, fitting.data, place, R, motion)}

    return measure


SENSOR = SensorType(
    CameraSensorParams, {"image": Image}, "camera_rate", fit, "camera", delivery="camera"
)
