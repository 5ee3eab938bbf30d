"""Turns an image into what a network takes, and pixels of the network back into the image's.

Networks count pixels from the left and the upper edge of the first one, as the boxes of their
training data do: its centre is (0.5, 0.5). Images here count from that centre. Of both scales the
edges lie on one another, so that

    u_network = gain * (u_image + 0.5) + offset

without a rest. ``gain`` is what the size was really changed by in each direction, whose rounding
to whole pixels makes it differ between the two.
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

_PAD = 114  # the gray around images with which the YOLO networks are trained
CELL = 32
"""Sides that are free are multiples of it: of the coarsest cells of most networks."""


class Resizing(Enum):
    """How an image is brought to the size that a network takes."""

    CENTER = "keeps its shape, with as much gray on both sides"
    CORNER = "keeps its shape, from the upper left corner, with gray after it"
    STRETCH = "fills all, stretched"
    WARP = "fills all, stretched, with the centre of the first pixel on that of the first pixel"


@dataclass(frozen=True)
class Preparation:
    """What a network was trained to take.

    Args:
        fit: how an image is brought to its size.
        order: of the colours, ``RGB`` or ``BGR``.
        mean, std: what is taken from each colour (0 to 255) and divided by, in that order.
        averaged: pixels are averaged where the image becomes smaller, as Pillow does it.
    """

    fit: Resizing
    order: str = "RGB"
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std: tuple[float, float, float] = (255.0, 255.0, 255.0)
    averaged: bool = False


@dataclass(frozen=True, eq=False)
class Placement:
    """Where an image lies in what a network was given: the formula's ``gain`` and ``offset``."""

    gain: Floats
    offset: Floats

    def to_image(self, found: Candidates) -> Candidates:
        """The same things in the image's pixels, origin at the centre of the top-left one."""
        boxes = (found.boxes_xyxy - np.tile(self.offset, 2)) / np.tile(self.gain, 2) - 0.5
        points, covariances = found.points_uv, found.covariances
        if points is not None:
            points = (points - self.offset) / self.gain - 0.5
        if covariances is not None:
            covariances = covariances / np.outer(self.gain, self.gain)
        return Candidates(boxes, found.scores, found.classes, points, covariances)


def fitting_size(image: Size, longest: int, fit: Resizing, cell: int = CELL) -> Size:
    """The size to give to a network that takes any, for an image: no more gray than needed.

    Args:
        image: its size.
        longest: the longer side of the result, rounded up to whole cells.
        fit: how the image is brought to it.
        cell: the side of the network's coarsest cells.
    """
    sides = (1, 1) if fit in (Resizing.STRETCH, Resizing.WARP) else image
    scale = longest / max(sides)
    width, height = (max(1, math.ceil(round(side * scale) / cell)) * cell for side in sides)
    return width, height


def prepare(pixels: Pixels, order: str, to: Preparation, blob: Floats) -> Placement:
    """Fill what a network takes with an image, and tell where that lies in it.

    Args:
        pixels: (height, width) or (height, width, 3 or 4), 8 or 16 bits; alpha is left out.
        order: of its colours.
        to: what the network was trained to take.
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
    """The size that the image gets, and where its left and its upper edge are then."""
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
    """Write the colours, as the network takes them, to its planes (3, height, width)."""
    colors: list[Pixels] = list(cv2.split(pixels)[:3])
    if len(colors) == 1:
        colors *= 3
    elif order != to.order:
        colors = colors[::-1]
    for plane, color, mean, std in zip(planes, colors, to.mean, to.std, strict=True):
        np.multiply(color, np.float32(1 / (std * unit(pixels))), out=plane, casting="same_kind")
        if mean:
            plane -= np.float32(mean / std)
