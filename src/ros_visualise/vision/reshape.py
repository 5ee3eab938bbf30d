"""Resize and flip, for pixels; `vision.calibration` has it for calibrations."""

from __future__ import annotations

from enum import Enum

import cv2

from ros_visualise.core.limits import check_image
from ros_visualise.data import Pixels

Size = tuple[int, int]
"""(width, height) in pixels."""


class Flip(Enum):
    """Direction of mirroring."""

    OFF = "off"
    HORIZONTAL = "horizontal"
    VERTICAL = "vertical"
    BOTH = "both"

    @property
    def horizontal(self) -> bool:
        """Left and right change places."""
        return self in (Flip.HORIZONTAL, Flip.BOTH)

    @property
    def vertical(self) -> bool:
        """Top and bottom change places."""
        return self in (Flip.VERTICAL, Flip.BOTH)


def target_size(size: Size, scale: float, width: int, height: int) -> Size:
    """The size to resize to, at least 1x1.

    Args:
        size: of the image.
        scale: factor for both sides, where neither width nor height is given.
        width, height: in pixels; where one is 0 it follows from the other and the aspect ratio.
    """
    if width and height:
        return width, height
    if width or height:
        scale = width / size[0] if width else height / size[1]
    return max(1, width or round(size[0] * scale)), max(1, height or round(size[1] * scale))


def resize(pixels: Pixels, size: Size) -> Pixels:
    """Resize, by area means where both sides shrink, else bilinear; same size is the same array.

    Raises:
        TooLarge: the pixels would take too much memory.
    """
    height, width = pixels.shape[:2]
    if size == (width, height):
        return pixels
    check_image(*size, pixels[0, 0].nbytes)
    shrinks = size[0] <= width and size[1] <= height
    return cv2.resize(pixels, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)


def flip(pixels: Pixels, way: Flip) -> Pixels:
    """Mirror; off returns the same array."""
    if way is Flip.OFF:
        return pixels
    return cv2.flip(pixels, {Flip.HORIZONTAL: 1, Flip.VERTICAL: 0, Flip.BOTH: -1}[way])
