"""Clearness of the cells of a tag."""

from __future__ import annotations

import cv2
import numpy as np

from ros_visualise.data import Floats, Pixels


def clearness(gray: Pixels, corners_uv: Floats, cells: int) -> float:
    """Gap between the brightest black and the darkest white cell: 1 in a perfect image.

    It is a fraction of the difference between the means of both. If cells of one colour differ
    much, as in most false detections, it is near 0; if the black rim is not black, it is negative.

    Args:
        gray: (height, width) uint8.
        corners_uv: (4, 2) pixels of the tag's square: lower left, lower right, and so on.
        cells: number along a side, including the black rim of one cell.
    """
    square = np.array([[0, cells], [cells, cells], [cells, 0], [0, 0]], np.float32)
    H = cv2.getPerspectiveTransform(square, corners_uv.astype(np.float32))
    middles = np.stack(np.meshgrid(*[np.arange(cells) + 0.5] * 2), axis=-1)
    places = cv2.perspectiveTransform(middles.astype(np.float32), H)
    u, v = cv2.split(places)
    levels = cv2.remap(gray, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    inner = levels[1:-1, 1:-1].astype(np.float64)
    rim = np.concatenate([levels[0], levels[-1], levels[1:-1, 0], levels[1:-1, -1]])
    is_white = inner > (inner.max() + rim.mean()) / 2
    black = np.concatenate([rim, inner[~is_white]])
    white = inner[is_white]
    contrast = white.mean() - black.mean() if white.size else 0.0
    return float((white.min() - black.max()) / contrast) if contrast > 0 else -1.0
