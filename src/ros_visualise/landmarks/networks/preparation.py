"""Conversion of images to network inputs, and of pixels back to the image.

Networks count pixels from the left and upper edge of the first one, as the boxes in their training
data do: its centre is (0.5, 0.5). Images here count from that centre. The edges of both coincide,
so that

    u_network = gain * (u_image + 0.5) + offset

exactly. ``gain`` is the real scale factor in each direction; rounding to whole pixels makes it
differ between the two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import cv2
import numpy as np

from ros_visualise.data import Floats, Pixels
from ros_visualise.landmarks.networks.candidates import Candidates
from ros_visualise.vision.depth import unit

Size = tuple[int, int]
"""(width, height), pixels."""

_PAD = 114  # gray padding in the training of YOLO networks
CELL = 32
"""Free sides are multiples of this, the coarsest cell of most networks."""


class Resizing(Enum):
    """Ways to bring an image to the size of a network's input."""

    CENTER = "aspect ratio kept, centred on gray"
    CORNER = "aspect ratio kept, image in the upper left corner, the rest gray"
    STRETCH = "stretched"
    WARP = "stretched, with the centres of the upper left pixels aligned"


@dataclass(frozen=True)
class Preparation:
    """The input that a network was trained with.

    Args:
        fit: how an image is resized.
        order: of the colours, ``RGB`` or ``BGR``.
        mean, std: subtracted from each colour (0 to 255), and divided by, in that order.
        averaged: pixels are averaged when shrinking, as in Pillow.
    """

    fit: Resizing
    order: str = "RGB"
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std: tuple[float, float, float] = (255.0, 255.0, 255.0)
    averaged: bool = False


@dataclass(frozen=True, eq=False)
class Placement:
    """Position of an image in a network's input: ``gain`` and ``offset`` of the formula."""

    gain: Floats
    offset: Floats

    def to_image(self, found: Candidates) -> Candidates:
        """The candidates in the image's pixels, origin at the centre of the top-left one."""
        boxes = (found.boxes_xyxy - np.tile(self.offset, 2)) / np.tile(self.gain, 2) - 0.5
        points, covariances = found.points_uv, found.covariances
        if points is not None:
            points = (points - self.offset) / self.gain - 0.5
        if covariances is not None:
            covariances = covariances / np.outer(self.gain, self.gain)
        return Candidates(boxes, found.scores, found.classes, points, covariances)


def fitting_size(image: Size, longest: int, fit: Resizing, cell: int = CELL) -> Size:
    """The input size for an image, with as little gray as possible.

    Args:
        image: its size.
        longest: the longer side of the result, rounded up to whole cells.
        fit: how the image is resized.
        cell: the side of the network's coarsest cells.
    """
    sides = (1, 1) if fit in (Resizing.STRETCH, Resizing.WARP) else image
    scale = longest / max(sides)
    width, height = (max(1, math.ceil(round(side * scale) / cell)) * cell for side in sides)
    return width, height


def prepare(pixels: Pixels, order: str, to: Preparation, blob: Floats) -> Placement:
    """Write an image to a network's input; returns its placement.

    Args:
        pixels: (height, width) or (height, width, 3 or 4), 8 or 16 bits; alpha is ignored.
        order: of its colours.
        to: the input that the network was trained with.
        blob: (1, 3, height, width), floats, to write to.
    """
    size = (pixels.shape[1], pixels.shape[0])
    taken, left, top = _layout(size, (blob.shape[3], blob.shape[2]), to.fit)
    scaled = _scale(pixels, taken, to)
    right, bottom = left + taken[0], top + taken[1]
    gray = np.reshape((_PAD - np.array(to.mean)) / to.std, (3, 1, 1))
    blob[0, :, :top], blob[0, :, bottom:] = gray, gray
    blob[0, :, top:bottom, :left], blob[0, :, top:bottom, right:] = gray, gray
    _write(scaled, order, to, blob[0, :, top:bottom, left:right])
    return Placement(np.array(taken) / size, np.array([left, top], np.float64))


def _layout(image: Size, network: Size, fit: Resizing) -> tuple[Size, int, int]:
    """The size of the resized image, and the position of its left and upper edge."""
    if fit in (Resizing.STRETCH, Resizing.WARP):
        return network, 0, 0
    scale = min(network[0] / image[0], network[1] / image[1])
    width = min(max(1, round(image[0] * scale)), network[0])
    height = min(max(1, round(image[1] * scale)), network[1])
    if fit is Resizing.CORNER:
        return (width, height), 0, 0
    return (width, height), (network[0] - width) // 2, (network[1] - height) // 2


def _scale(pixels: Pixels, size: Size, to: Preparation) -> Pixels:
    before = (pixels.shape[1], pixels.shape[0])
    if before == size:
        return pixels
    if to.fit is Resizing.WARP:
        matrix = np.diag([size[0] / before[0], size[1] / before[1], 1.0])[:2]
        return cv2.warpAffine(pixels, matrix, size, borderMode=cv2.BORDER_REPLICATE)
    is_smaller = size[0] < before[0] or size[1] < before[1]
    how = cv2.INTER_AREA if to.averaged and is_smaller else cv2.INTER_LINEAR
    return cv2.resize(pixels, size, interpolation=how)


def _write(pixels: Pixels, order: str, to: Preparation, planes: Floats) -> None:
    """Write the colours to the planes (3, height, width) of the input."""
    colors: list[Pixels] = list(cv2.split(pixels)[:3])
    if len(colors) == 1:
        colors *= 3
    elif order != to.order:
        colors = colors[::-1]
    for plane, color, mean, std in zip(planes, colors, to.mean, to.std, strict=True):
        np.multiply(color, np.float32(1 / (std * unit(pixels))), out=plane, casting="same_kind")
        if mean:
            plane -= np.float32(mean / std)
