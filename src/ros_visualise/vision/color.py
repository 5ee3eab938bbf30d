"""Colour: gray, Bayer mosaics, HSV ranges, luma.

``order`` is the order of the first three channels, ``BGR`` or ``RGB``.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

import cv2
import numpy as np

from ros_visualise.core.errors import UnsupportedImage
from ros_visualise.data import MEASUREMENTS, Image, Pixels
from ros_visualise.vision.depth import to_8_bit


class HsvMode(Enum):
    """Use of the pixels in an HSV range."""

    OFF = "off"
    KEEP = "keep"
    MASK = "mask"


def is_bayer(encoding: str) -> bool:
    """A mosaic with one colour per pixel."""
    return encoding.startswith("bayer_")


def order_of(encoding: str) -> str:
    """The order of an encoding's colours, ``BGR`` by default."""
    return "RGB" if encoding.startswith("rgb") else "BGR"


def encoding_of(pixels: Pixels, order: str) -> str:
    """The name of an encoding by its array, such as ``mono16`` or ``bgra8``."""
    bits = 8 * pixels.dtype.itemsize
    if pixels.ndim == 2:
        return f"mono{bits}"
    return f"{order.lower()}{'a' if pixels.shape[2] == 4 else ''}{bits}"


def to_gray(pixels: Pixels, order: str) -> Pixels:
    """Luma, 0.299 R + 0.587 G + 0.114 B; gray is unchanged, alpha is dropped."""
    if pixels.ndim == 2:
        return pixels
    alpha = "A" if pixels.shape[2] == 4 else ""
    return cv2.cvtColor(pixels, getattr(cv2, f"COLOR_{order}{alpha}2GRAY"))


def to_bgr(pixels: Pixels, order: str) -> Pixels:
    """Three channels in the order BGR; alpha is dropped."""
    source = "GRAY" if pixels.ndim == 2 else order + ("A" if pixels.shape[2] == 4 else "")
    return pixels if source == "BGR" else cv2.cvtColor(pixels, getattr(cv2, f"COLOR_{source}2BGR"))


def demosaic(mosaic: Pixels, encoding: str) -> Pixels:
    """BGR by bilinear interpolation of a Bayer mosaic.

    Args:
        mosaic: (height, width).
        encoding: such as ``bayer_rggb8``, the colours of the top-left 2x2 pixels in reading order.
    """
    pattern = encoding[len("bayer_") :][:4].upper()
    code = getattr(cv2, f"COLOR_Bayer{pattern}2BGR")
    if min(mosaic.shape) > 2:
        return cv2.cvtColor(mosaic, code)
    # OpenCV leaves less than 3 rows or columns black; this border continues the pattern
    wide = cv2.copyMakeBorder(mosaic, 2, 2, 2, 2, cv2.BORDER_REFLECT_101)
    return np.ascontiguousarray(cv2.cvtColor(wide, code)[2:-2, 2:-2])


def demosaiced(pixels: Pixels, encoding: str) -> Pixels:
    """The pixels as colours or gray: mosaics are demosaiced."""
    return demosaic(pixels, encoding) if is_bayer(encoding) else pixels


def gray_of(image: Image) -> Pixels:
    """An image in gray of 8 bits.

    Raises:
        UnsupportedImage: it holds measurements, such as depth.
    """
    refuse_measurements(image.encoding)
    pixels = demosaiced(image.pixels, image.encoding)
    return to_8_bit(to_gray(pixels, order_of(image.encoding)))


def bgr_of(image: Image) -> Pixels:
    """An image in BGR of 8 bits; raises as `gray_of`."""
    refuse_measurements(image.encoding)
    pixels = demosaiced(image.pixels, image.encoding)
    return to_bgr(to_8_bit(pixels), order_of(image.encoding))


def refuse_measurements(encoding: str) -> None:
    """Refuse depth and other measurements.

    Raises:
        UnsupportedImage: images of this encoding hold measurements, not gray or colour values.
    """
    if encoding in MEASUREMENTS:
        raise UnsupportedImage(
            f"{encoding} holds measurements, not gray or colour values; show this topic directly"
        )


def keep_alpha(process: Callable[[Pixels], Pixels], pixels: Pixels) -> Pixels:
    """Process the colours of an image and give the result the alpha that it had."""
    if pixels.shape[2:] != (4,):
        return process(pixels)
    colors = pixels[..., :3]
    after = process(colors)
    if after is colors:
        return pixels
    return after if after.ndim == 2 else np.dstack((after, pixels[..., 3]))


def on_luma(process: Callable[[Pixels], Pixels], pixels: Pixels, order: str) -> Pixels:
    """Process gray, or the luma Y of the YCrCb form of a colour image, whose chroma stays."""
    if pixels.ndim == 2:
        return process(pixels)
    luma, *chroma = cv2.split(cv2.cvtColor(pixels, getattr(cv2, f"COLOR_{order}2YCrCb")))
    merged = cv2.merge((process(luma), *chroma))
    return cv2.cvtColor(merged, getattr(cv2, f"COLOR_YCrCb2{order}"))


def select_hsv(
    pixels: Pixels,
    order: str,
    mode: HsvMode,
    low: tuple[int, int, int],
    high: tuple[int, int, int],
) -> Pixels:
    """The colours within a range: the others turned black (keep), or a mono8 mask of 255.

    Args:
        pixels: three channels.
        order: of the channels.
        mode: keep or mask.
        low, high: hue 0-179 (degrees / 2), saturation and value 0-255, both included; a lower hue
            above the upper one reaches through red.

    Raises:
        UnsupportedImage: the image is gray.
    """
    if mode is HsvMode.OFF:
        return pixels
    if pixels.ndim == 2:
        raise UnsupportedImage("hsv needs colour and this image is gray: set gray=false or hsv=off")
    mask = hsv_mask(pixels, order, low, high)
    return mask if mode is HsvMode.MASK else cv2.bitwise_and(pixels, pixels, mask=mask)


def hsv_mask(
    pixels: Pixels, order: str, low: tuple[int, int, int], high: tuple[int, int, int]
) -> Pixels:
    """255 where hue, saturation and value are within the range, as `select_hsv` has it."""
    hsv = cv2.cvtColor(to_8_bit(pixels), getattr(cv2, f"COLOR_{order}2HSV"))
    if low[0] <= high[0]:
        return cv2.inRange(hsv, low, high)
    below_red = cv2.inRange(hsv, low, (179, *high[1:]))
    above_red = cv2.inRange(hsv, (0, *low[1:]), high)
    return cv2.bitwise_or(below_red, above_red)
