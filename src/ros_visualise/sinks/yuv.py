"""Images as a video encoder takes them: 8-bit YUV 4:2:0 of even size, BT.601, studio range."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import MEASUREMENTS, Image
from ros_visualise.vision.measurements import to_picture

Bytes = npt.NDArray[Any]  # of uint8; OpenCV's own stubs are wider than that

_STUDIO_RANGE = np.round(16 + np.arange(256) * 219 / 255).astype(np.uint8)
_NEUTRAL = 128


def even_size(image: Image) -> tuple[int, int]:
    """(Width, height) of the image, one more where it is odd."""
    return image.width + image.width % 2, image.height + image.height % 2


def to_i420(image: Image, size: tuple[int, int]) -> Bytes:
    """The planes Y, U and V below one another: (height * 3 / 2, width).

    An odd row or column is doubled; an image of any other size is scaled.
    """
    pixels, order = _to_8_bit(image)
    if even_size(image) == size:
        right, bottom = size[0] - image.width, size[1] - image.height
        if right or bottom:
            pixels = cv2.copyMakeBorder(pixels, 0, bottom, 0, right, cv2.BORDER_REPLICATE)
    else:
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    if order == "gray":
        return _gray_to_i420(pixels)
    return cv2.cvtColor(pixels, getattr(cv2, f"COLOR_{order}2YUV_I420"))


def _to_8_bit(image: Image) -> tuple[Bytes, str]:
    """Pixels, and the order of their channels as OpenCV names it; a mosaic becomes colour."""
    pixels: Bytes = image.pixels
    if image.encoding in MEASUREMENTS:
        return to_picture(pixels), "BGR"
    if pixels.dtype == np.uint16:
        pixels = cv2.convertScaleAbs(pixels, alpha=255 / 65535)
    kind = image.encoding.rstrip("0123456789")
    if kind == "mono":
        return np.ascontiguousarray(pixels, np.uint8), "gray"
    if kind.startswith("bayer_"):
        pattern = kind.removeprefix("bayer_").upper()
        return cv2.cvtColor(pixels, getattr(cv2, f"COLOR_Bayer{pattern}2BGR")), "BGR"
    return np.ascontiguousarray(pixels, np.uint8), kind.upper()


def _gray_to_i420(gray: Bytes) -> Bytes:
    height, width = gray.shape
    planes = np.full((height * 3 // 2, width), _NEUTRAL, np.uint8)
    cv2.LUT(gray, _STUDIO_RANGE, dst=planes[:height])
    return planes
