"""Canny's steps after the derivative, as in OpenCV: identical for every pixel.

Source: Canny, A computational approach to edge detection, 1986; OpenCV, imgproc/src/canny.cpp.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Pixels
from ros_visualise.lessons.methods.sobel import Whole, sobel

Mask = npt.NDArray[np.bool_]

NEIGHBOURS = ((1, 0), (1, 1), (0, 1), (-1, 1))
"""(x, y) from a pixel to one of its neighbours, by the class of the gradient's direction."""

_BITS = 15
_TAN_22_5 = round((2**0.5 - 1) * 2**_BITS)
_SHRUNK = 16  # with the 7x7 kernel, gradients and thresholds are divided by this
_LARGEST = 32767.0


@dataclass(frozen=True, eq=False)
class Gradient:
    """The gradient of each pixel of a gray image: to the right, and down."""

    gray: Pixels
    dx: Whole
    dy: Whole
    aperture: int
    is_l2: bool

    @property
    def size(self) -> Whole:
        """Magnitude, (height, width): |dx| + |dy|, or in L2 its square, dx² + dy²."""
        return self.dx**2 + self.dy**2 if self.is_l2 else abs(self.dx) + abs(self.dy)

    def threshold(self, level: float) -> int:
        """A threshold as it is compared with `size`."""
        level /= _SHRUNK if self.aperture == 7 else 1
        return int(min(_LARGEST, level) ** 2 if self.is_l2 else level)


def gradient(gray: Pixels, aperture: int, is_l2: bool) -> Gradient:
    """Sobel's derivatives.

    Args:
        gray: 8 bits.
        aperture: of the kernel, 3, 5 or 7.
        is_l2: use the Euclidean norm.
    """
    dx, dy = sobel(gray, aperture)
    if aperture == 7:
        dx, dy = (np.rint(one / _SHRUNK).astype(np.int64) for one in (dx, dy))
    return Gradient(gray, dx, dy, aperture, is_l2)


def direction_class(found: Gradient) -> Whole:
    """0 to 3, index in `NEIGHBOURS` of the nearest of four directions."""
    x, y = abs(found.dx), abs(found.dy) << _BITS
    is_flat = y < x * _TAN_22_5
    is_steep = y > x * _TAN_22_5 + (x << (_BITS + 1))  # tan 67.5 is tan 22.5 + 2
    slanted = np.where((found.dx ^ found.dy) >= 0, 1, 3)
    kinds: Whole = np.where(is_flat, 0, np.where(is_steep, 2, slanted))
    return kinds


def is_maximum(found: Gradient) -> Mask:
    """Mask of pixels whose gradient is at least that of both neighbours along its direction.

    Of two equal ones, the left or upper one stays; on a diagonal neither does.
    """
    size = found.size
    height, width = size.shape
    wide = np.pad(size, 1)
    kinds = direction_class(found)
    keeps: Mask = np.zeros(size.shape, bool)
    for kind, (x, y) in enumerate(NEIGHBOURS):
        after = wide[1 + y : 1 + y + height, 1 + x : 1 + x + width]
        before = wide[1 - y : 1 - y + height, 1 - x : 1 - x + width]
        is_kept = (size > before) & (size >= after if kind in (0, 2) else size > after)
        keeps |= is_kept & (kinds == kind)
    return keeps


@dataclass(frozen=True, eq=False)
class Edges:
    """Masks (height, width) of the candidates: above the high threshold; above the low one and
    connected with such a one; above the low one and not."""

    strong: Mask
    rescued: Mask
    lost: Mask

    @property
    def pixels(self) -> Pixels:
        """255 on an edge, else 0."""
        pixels: Pixels = np.where(self.strong | self.rescued, np.uint8(255), np.uint8(0))
        return pixels


def hysteresis(found: Gradient, keeps: Mask, low: float, high: float) -> Edges:
    """Strong pixels, and weak ones connected to them by a chain of (also diagonal) neighbours.

    Args:
        found: the gradient.
        keeps: the pixels left by `is_maximum`.
        low, high: thresholds, in any order.
    """
    low, high = sorted((low, high))
    candidates = keeps & (found.size > found.threshold(low))
    strong = candidates & (found.size > found.threshold(high))
    count, chains = cv2.connectedComponents(candidates.astype(np.uint8), connectivity=8)
    holds: Mask = np.zeros(count, bool)
    holds[chains[strong]] = True
    rescued = candidates & holds[chains] & ~strong
    return Edges(strong, rescued, candidates & ~strong & ~rescued)


def opencv_edges(found: Gradient, low: float, high: float) -> Pixels:
    """Edges of the same image by OpenCV."""
    edges: Pixels = cv2.Canny(
        found.gray, low, high, apertureSize=found.aperture, L2gradient=found.is_l2
    )
    return edges
