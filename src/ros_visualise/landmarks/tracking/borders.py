"""Boxes at the borders of an image, which show only a part of their object."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

_TOUCHES = 0.08  # of a side, by which detectors place edges beside the border,
_TOUCHES_PX = 1.5


def in_view(boxes: Floats, size: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """True for boxes (N, 4) whose centre is within an image of this width and height."""
    u, v = boxes[:, 0], boxes[:, 1]
    return (u >= 0) & (u < size[0]) & (v >= 0) & (v < size[1])


def clipped(boxes: Floats, size: tuple[int, int]) -> Floats:
    """The part of each box (N, 4) that an image of this width and height shows."""
    ends = np.subtract(size, 0.5)
    low = np.clip(boxes[:, :2] - boxes[:, 2:] / 2, -0.5, ends - 1)
    high = np.clip(boxes[:, :2] + boxes[:, 2:] / 2, 0.5, ends)
    return np.hstack(((low + high) / 2, high - low))


def completed(boxes: Floats, expected: Floats, size: tuple[int, int]) -> Floats:
    """Boxes (N, 4) that touch a border, enlarged beyond it to the size of the expected ones.

    An object that leaves the image goes on at its speed, though the centre of what is seen of it
    slows down.
    """
    half = boxes[:, 2:] / 2
    low, high, near = (
        boxes[:, :2] - half,
        boxes[:, :2] + half,
        _TOUCHES * boxes[:, 2:] + _TOUCHES_PX,
    )
    at_low, at_high = low < near, high > np.subtract(size, 1) - near
    more = np.maximum(expected[:, 2:] - boxes[:, 2:], 0)
    low, high = low - more * (at_low & ~at_high), high + more * (at_high & ~at_low)
    return np.hstack(((low + high) / 2, high - low))
