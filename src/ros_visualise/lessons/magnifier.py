"""Enlarged pixels of a picture, around a chosen one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Floats, Image, Pixels
from ros_visualise.lessons.lesson import FigureImage
from ros_visualise.plotting.colors import YELLOW, Color
from ros_visualise.plotting.figure import Box, Figure

_LEFT, _SIDE = 240, 400  # width of the pictures on the left, and of the pixels on the right
_GAP = 8


@dataclass(frozen=True)
class PixelParams:
    """The pixel to look at."""

    x: int = param(-1, "column of the pixel (click the picture to choose it); -1: "
        "automatic",
                   min=-1, max=4096, slider=(-1, 640))  # fmt: skip
    y: int = param(-1, "row of the pixel", min=-1, max=4096, slider=(-1, 480))

    def pixel(self, shape: tuple[int, ...], otherwise: tuple[int, int]) -> tuple[int, int]:
        """(x, y) of the chosen pixel, or of the default.

        Args:
            shape: of the picture: height, width.
            otherwise: the default.
        """
        if self.x < 0 or self.y < 0:
            return otherwise
        return min(self.x, shape[1] - 1), min(self.y, shape[0] - 1)


def pixel_at(image: Image, across: float, down: float) -> tuple[int, int] | None:
    """(x, y) of the pixel of a lesson's picture at a point of a step's image.

    Args:
        image: of the step.
        across, down: fractions of its width and height, 0 to 1.
    """
    if isinstance(image.data, FigureImage):
        figure = image.data.figure
        return figure.pixel_at(across * figure.width, down * figure.height)
    return int(across * image.width), int(down * image.height)


class Zoom:
    """The pixels around one, enlarged, each with its number.

    Args:
        figure: to draw on.
        box: square to fill.
        center: (x, y) of the pixel.
        reach: number of pixels on each side of it.
    """

    def __init__(self, figure: Figure, box: Box, center: tuple[int, int], reach: int) -> None:
        self._figure, self._box = figure, box
        self._center, self._reach = center, reach
        self._side = box[2] / (2 * reach + 1)

    def draw(self, picture: Pixels, numbers: Floats | Pixels | None = None) -> None:
        """Draw a picture, and numbers (height, width) in its pixels if given."""
        x, y = self._center
        n = self._reach
        wide = cv2.copyMakeBorder(picture, n, n, n, n, cv2.BORDER_CONSTANT)
        patch = wide[y : y + 2 * n + 1, x : x + 2 * n + 1]
        self._figure.picture(self._box, np.ascontiguousarray(patch), (x - n, y - n))
        if numbers is None:
            return
        luma = patch if patch.ndim == 2 else cv2.cvtColor(patch, cv2.COLOR_BGR2GRAY)
        height, width = picture.shape[:2]
        for row in range(max(0, y - n), min(height, y + n + 1)):
            for column in range(max(0, x - n), min(width, x + n + 1)):
                is_bright = luma[row - y + n, column - x + n] > 110
                ink = (0, 0, 0) if is_bright else (255, 255, 255)
                place = self.place(column, row)
                text = f"{numbers[row, column]:.0f}"
                size = min(17.0, 1.5 * self._side / len(text))
                self._figure.text(place[0], place[1] + size / 3, text, size, "middle", ink)

    def mark(self, x: int, y: int, color: Color) -> None:
        """Outline a pixel."""
        left, top = self.place(x, y) - self._side / 2
        self._figure.outline((left, top, self._side, self._side), color, 3)

    def place(self, x: float, y: float) -> Floats:
        """(2,) centre of a pixel on the figure."""
        from_center = np.array([x - self._center[0], y - self._center[1]]) + self._reach + 0.5
        return np.array(self._box[:2]) + from_center * self._side


def magnified(
    pictures: Sequence[Pixels], pixel: tuple[int, int], reach: int
) -> tuple[Figure, Zoom]:
    """A figure with pictures of one size below each other, and room for pixels beside them.

    Args:
        pictures: to draw; the enlarged part is framed in the first.
        pixel: (x, y) of the central pixel.
        reach: number of pixels on each side of it.
    """
    height, width = pictures[0].shape[:2]
    each = (_SIDE - _GAP * (len(pictures) - 1)) / len(pictures)
    scale = min(_LEFT / width, each / height)
    figure = Figure(_LEFT + _GAP + _SIDE, _SIDE)
    for number, picture in enumerate(pictures):
        top = number * (height * scale + _GAP)
        figure.picture((0, top, width * scale, height * scale), picture, (0, 0))
    half = (reach + 0.5) * scale + 3
    left, top = (pixel[0] + 0.5) * scale - half, (pixel[1] + 0.5) * scale - half
    figure.outline((left, top, 2 * half, 2 * half), YELLOW)
    return figure, Zoom(figure, (_LEFT + _GAP, 0, _SIDE, _SIDE), pixel, reach)
