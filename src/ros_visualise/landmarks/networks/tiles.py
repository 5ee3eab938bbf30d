"""Detection in overlapping tiles of a large image, at full resolution.

A network for 640 pixels gets a 4K image six times smaller, and objects of 60 pixels are lost. Tiles
show them as they are. The whole image is looked at, too: what is larger than a tile is in none.

Source of the idea: Akyon et al., Slicing aided hyper inference, 2022.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Pixels
from ros_visualise.landmarks.networks.candidates import Candidates, SelectionRules, choose, join
from ros_visualise.landmarks.networks.preparation import Size

OVERLAP = 0.2
"""Overlap of neighbours as a fraction of a tile's side: what is smaller is whole in one of them."""
_CUT_PX = 2.0
"""A box this close to an edge inside the image is cut by it."""
_WITHIN = 0.8
"""Fraction of a box inside a more certain one of its class from which it is a part of that."""

Tile = tuple[int, int, int, int]
"""Left, top, right and bottom, pixels."""


class Detector(Protocol):
    """Whatever detects in one image, as `Network` does."""

    def detect(self, pixels: Pixels, order: str, choice: SelectionRules) -> Candidates: ...


def detect_in_tiles(
    network: Detector, pixels: Pixels, order: str, choice: SelectionRules, side: int
) -> Candidates:
    """`Network.detect` in a whole image and in its tiles.

    Args:
        side: of the tiles, pixels; 0 or more than the image's sides: the whole image only.
    """
    whole = network.detect(pixels, order, choice)
    size = (pixels.shape[1], pixels.shape[0])
    if not side or side >= max(size):
        return whole
    found = [whole]
    for tile in tiles_of(size, side):
        left, top, right, bottom = tile
        inside = network.detect(pixels[top:bottom, left:right], order, choice)
        found.append(_uncut(inside.moved(left, top), tile, size))
    return _without_parts(choose(join(found), choice, overlapping=True))


def tiles_of(image: Size, side: int) -> list[Tile]:
    """Tiles that cover an image of this width and height, row by row."""
    columns, rows = (_starts(length, side) for length in image)
    width, height = (min(side, length) for length in image)
    return [(x, y, x + width, y + height) for y in rows for x in columns]


def _starts(length: int, side: int) -> list[int]:
    """First pixels of the tiles along one side, at equal distances."""
    if side >= length:
        return [0]
    step = side - math.ceil(OVERLAP * side)
    count = math.ceil((length - side) / step) + 1
    return [round(number * (length - side) / (count - 1)) for number in range(count)]


def _uncut(found: Candidates, tile: Tile, image: Size) -> Candidates:
    """Those not cut by an edge of a tile that is not an edge of the image."""
    # boxes count from pixel centres, so that edges are half a pixel further out
    edges = np.array(tile) - 0.5
    far = np.array([0, 0, image[0], image[1]])
    near = np.abs(found.boxes_xyxy - edges) < _CUT_PX
    inner = np.array(tile) != far
    return found.take(~(near & inner).any(axis=1))


def _without_parts(found: Candidates) -> Candidates:
    """Those that are no parts of a more certain one of their class; the best come first."""
    boxes = found.boxes_xyxy.astype(np.float64)
    shared = _shared_areas(boxes)
    within = shared > _WITHIN * np.diagonal(shared)[:, None]
    same = found.classes[:, None] == found.classes
    better = np.tri(len(found), k=-1, dtype=bool)
    return found.take(~(within & same & better).any(axis=1))


def _shared_areas(boxes: Floats) -> npt.NDArray[np.float64]:
    """(N, N) intersections of boxes, pixels; the diagonal holds their own areas."""
    low = np.maximum(boxes[:, None, :2], boxes[:, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[:, 2:])
    return np.asarray(np.prod(np.clip(high - low, 0, None), axis=2))
