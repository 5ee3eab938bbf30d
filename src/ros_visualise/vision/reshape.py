"""Resize and flip, for pixels and calibrations."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.core.limits import check_image
from ros_visualise.data import CameraInfo, Pixels

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


Matrix = npt.NDArray[np.float64]

# of p1 p2, thin prism s1 s2 s3 s4, tilt tau_x tau_y in OpenCV's order of the coefficients
_ODD_IN_X = [3, 8, 9, 13]
_ODD_IN_Y = [2, 10, 11, 12]


def resized(info: CameraInfo, before: Size, after: Size) -> CameraInfo:
    """The calibration of the image resized from ``before`` to ``after``; D and R stay."""
    scale = np.divide(after, before)
    to_new = np.diag([*scale, 1.0])
    to_new[:2, 2] = (scale - 1) / 2
    return replace(
        info,
        width=after[0],
        height=after[1],
        K=to_new @ info.K,
        P=None if info.P is None else to_new @ info.P,
    )


def flipped(info: CameraInfo, size: Size, *, horizontal: bool, vertical: bool) -> CameraInfo:
    """The calibration of the mirrored image: what it sees is the mirrored world.

    A point (x, y, z) of the camera's frame is at (-x, y, z) after a horizontal flip; focal lengths
    stay positive.

    Args:
        info: calibration of the original image.
        size: of the image.
        horizontal, vertical: which ways it is mirrored.
    """
    signs = np.array([-1.0 if horizontal else 1.0, -1.0 if vertical else 1.0])
    mirror = np.diag([*signs, 1.0])
    to_new = mirror.copy()
    to_new[:2, 2] = np.where(signs < 0, np.subtract(size, 1), 0)
    mirror_4 = np.diag([*signs, 1.0, 1.0])
    return replace(
        info,
        K=to_new @ info.K @ mirror,
        D=_mirrored_distortion(info, horizontal, vertical),
        R=mirror @ info.R @ mirror,
        P=None if info.P is None else to_new @ info.P @ mirror_4,
    )


def _mirrored_distortion(info: CameraInfo, horizontal: bool, vertical: bool) -> Matrix:
    if info.distortion_model == "equidistant":
        return info.D  # radial alone
    signs = np.ones(max(14, len(info.D)))
    signs[_ODD_IN_X] *= -1 if horizontal else 1
    signs[_ODD_IN_Y] *= -1 if vertical else 1
    return info.D * signs[: len(info.D)]
