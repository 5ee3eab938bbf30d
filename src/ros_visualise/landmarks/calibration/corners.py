"""Subpixel refinement and verification of corners between black and white."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Pixels

Bools = npt.NDArray[np.bool_]

_WINDOWS = (2, 20)
_MOVED = (1.5, 0.06)  # largest refinement: pixels, and fraction of a square
_CONTRAST = 20  # levels between black and white
_STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)


def refine(gray: Pixels, uv: Floats, half: float) -> Floats:
    """Refine corners (N, 2); NaN too near to the image border.

    Args:
        half: half the window, pixels.
    """
    window = int(np.clip(half, *_WINDOWS))
    found = np.full(uv.shape, np.nan)
    size = gray.shape[::-1]
    is_inside = ((uv > window) & (uv < np.subtract(size, 1 + window))).all(axis=1)
    if is_inside.any():
        start = uv[is_inside].astype(np.float32).reshape(-1, 1, 2)
        found[is_inside] = cv2.cornerSubPix(gray, start, (window,) * 2, (-1, -1), _STOP)[:, 0]
    return found


def are_in_place(uv: Floats, start: Floats, sides: Floats) -> Bools:
    """Mask of corners that stayed where they were seen; ``sides``: of their squares, pixels."""
    least, share = _MOVED
    reach = np.maximum(least, share * sides)
    return np.asarray(np.linalg.norm(uv - start, axis=1) <= reach)


def are_crossings(gray: Pixels, square: Floats, H: Any, share: float) -> Bools:
    """Mask of corners (4,) of a square that black and white surround as on a board.

    Args:
        square: (4, 2) on the board.
        H: homography from the board to pixels.
        share: distance from the corner to check, as a fraction of the square's side.
    """
    step = float(square[1, 0] - square[0, 0]) * share
    around = square[:, None] + step * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    seen = np.rint(to_pixels(around.reshape(-1, 2), H)).astype(int)
    u, v = (np.clip(seen[:, axis], 0, gray.shape[1 - axis] - 1) for axis in (0, 1))
    level = gray[v, u].reshape(4, 4).astype(int)
    inside = np.arange(4)
    dark = [level[inside, (inside + turn) % 4] for turn in (0, 2)]
    light = [level[inside, (inside + turn) % 4] for turn in (1, 3)]
    return np.asarray(np.minimum(*light) - np.maximum(*dark) > _CONTRAST)


def to_pixels(places: Floats, H: Any) -> Floats:
    """Points (N, 2) on the board mapped by a homography, pixels."""
    return np.asarray(cv2.perspectiveTransform(places[:, None], H), np.float64)[:, 0]
