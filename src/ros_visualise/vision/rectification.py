"""Rectification: an image as a camera without distortion would have taken it.

Source: image_geometry, PinholeCameraModel::rectifyImage, which image_proc calls.
"""

from __future__ import annotations

import math
from dataclasses import replace
from enum import Enum
from functools import lru_cache
from typing import Any, NamedTuple

import cv2
import numpy as np

from ros_visualise.core.errors import UnsupportedImage
from ros_visualise.data import CameraInfo, Floats, Pixels
from ros_visualise.vision.reshape import Size

_COEFFICIENTS = {
    "plumb_bob": (0, 4, 5),
    "rational_polynomial": (8, 12, 14),
    "equidistant": (4,),
}
"""Models of distortion -> possible numbers of coefficients."""

_DEPTHS = ("uint8", "uint16", "int16", "float32", "float64")  # of which OpenCV can make images


class Interpolation(Enum):
    """Interpolation between pixels."""

    NEAREST = "nearest"
    LINEAR = "linear"
    CUBIC = "cubic"
    LANCZOS4 = "lanczos4"


class Model(NamedTuple):
    """A camera as OpenCV takes it: how it sees, and how the rectified image is to be laid out."""

    size: Size
    K: Floats
    D: Floats
    R: Floats
    P: Floats
    is_fisheye: bool

    @property
    def is_ideal(self) -> bool:
        """True if rectifying would change nothing."""
        is_turned = not np.array_equal(self.R, np.eye(3))
        is_distorted = self.is_fisheye or self.D.any()
        return not (is_distorted or is_turned) and np.array_equal(self.P[:, :3], self.K)


def model_of(info: CameraInfo, alpha: float) -> Model:
    """Rectification of the images of a calibrated camera.

    Args:
        info: its calibration.
        alpha: below 0: by R and P of the calibration. Else the field of view of the rectified
            image, from 0, valid pixels only, to 1, every pixel of the camera; by K and D alone, as
            cameracalibrator does for a single camera.

    Raises:
        UnsupportedImage: unknown model of distortion.
    """
    is_fisheye, D = distortion_of(info)
    size = (info.width, info.height)
    if alpha < 0:
        P = info.P if info.P is not None and info.P[0, 0] else _without_offset(info.K)
        R = info.R if info.R.any() else np.eye(3)
        return Model(size, info.K, D, R, P, is_fisheye)
    if is_fisheye:
        estimate = cv2.fisheye.estimateNewCameraMatrixForUndistortRectify
        laid_out = estimate(info.K, D, size, np.eye(3), balance=alpha)
    else:
        laid_out, _ = cv2.getOptimalNewCameraMatrix(info.K, D, size, alpha)
    P = _without_offset(np.asarray(laid_out, np.float64))
    return Model(size, info.K, D, np.eye(3), P, is_fisheye)


def rectify(pixels: Pixels, model: Model, interpolation: Interpolation) -> Pixels:
    """The rectified image; where the camera saw nothing it is 0, and NaN in floating point.

    Raises:
        UnsupportedImage: OpenCV cannot do that with pixels of this type.
    """
    if pixels.dtype.name not in _DEPTHS:
        raise UnsupportedImage(f"images of type {pixels.dtype} cannot be rectified")
    if model.is_ideal:
        return pixels
    numbers = [array.astype(np.float64).tobytes() for array in model[1:5]]
    maps = _maps(model.size, *numbers, model.is_fisheye)
    flag = getattr(cv2, f"INTER_{interpolation.name}")
    beyond: Any = (math.nan,) * 4 if pixels.dtype.kind == "f" else 0
    return cv2.remap(pixels, *maps, flag, borderMode=cv2.BORDER_CONSTANT, borderValue=beyond)


def rectified(info: CameraInfo, model: Model) -> CameraInfo:
    """The calibration of the rectified image: no distortion, no rotation, and K is that of P."""
    return replace(
        info,
        K=model.P[:, :3].copy(),
        D=np.zeros(5),
        R=np.eye(3),
        P=model.P,
        distortion_model="plumb_bob",
    )


@lru_cache(maxsize=2)
def _maps(
    size: Size, K: bytes, D: bytes, R: bytes, P: bytes, is_fisheye: bool
) -> tuple[Pixels, Pixels]:
    """Source of each pixel, as OpenCV's fast maps of whole pixels and 32nds of them."""
    k, d, r, p = (np.frombuffer(numbers) for numbers in (K, D, R, P))
    make = cv2.fisheye.initUndistortRectifyMap if is_fisheye else cv2.initUndistortRectifyMap
    projection = p.reshape(3, 4)[:, :3].copy()
    return make(k.reshape(3, 3), d, r.reshape(3, 3), projection, size, cv2.CV_16SC2)


def distortion_of(info: CameraInfo) -> tuple[bool, Floats]:
    """True if the model of distortion is the fisheye's, and its coefficients.

    Raises:
        UnsupportedImage: the model is unknown, or it has another number of coefficients.
    """
    name = info.distortion_model or "plumb_bob"
    allowed = _COEFFICIENTS.get(name)
    if allowed is None:
        known = ", ".join(_COEFFICIENTS)
        raise UnsupportedImage(f"unsupported distortion_model {name!r}; use one of {known}")
    if len(info.D) not in allowed:
        counts = " or ".join(map(str, allowed))
        raise UnsupportedImage(
            f"the calibration has {len(info.D)} coefficients of {name}, which needs {counts}"
        )
    return name == "equidistant", info.D


def _without_offset(K: Floats) -> Floats:
    return np.column_stack([K, np.zeros(3)])
