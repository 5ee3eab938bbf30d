"""Corners that are followed from image to image.

Corners are the best ones of the cells of a grid, so that they cover the image. They are followed by
pyramidal optical flow, there and back: what does not return to where it began is dropped.

Source: J. Shi, C. Tomasi, Good features to track, CVPR 1994; J.-Y. Bouguet, Pyramidal
implementation of the Lucas Kanade feature tracker, 2000; Z. Kalal et al., Forward-backward error:
automatic detection of tracking failures, ICPR 2010.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Pixels

Ids = npt.NDArray[np.int64]

PATCH = 17
"""Side of the patch around a corner, pixels: OpenCV works on 8 at a time, so 21 take twice as long.
"""
_LEVELS = 4
_BACK_LEVELS = 1  # on the way back, which begins where the corner was
_RETURN_PX = 0.7  # from where a corner began
_AROUND = 4  # rows beyond those wanted, on which corners depend
_MARGIN = 8  # pixels at the border of the image without corners
_LEAST_CORNER = 2e-5  # least eigenvalue of a corner, of gray levels from 0 to 1
_RELATIVE = 0.01  # of the eigenvalue of good corners of this image
_STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 0.03)


class FollowedCorners(NamedTuple):
    """Corners in an image: their numbers (N,), in order, and pixels (N, 2).

    ``before_uv`` (N, 2) is where they were in the image before; NaN of new ones.
    """

    ids: Ids
    pixels_uv: Floats
    before_uv: Floats

    def chosen(self, kept: npt.NDArray[Any]) -> FollowedCorners:
        """Some of them, by a mask or by their places."""
        return FollowedCorners(self.ids[kept], self.pixels_uv[kept], self.before_uv[kept])


class CornerTracker:
    """Follows corners through the images of a camera.

    Args:
        count: number of corners wanted; up to half as many again are followed.

    Attributes:
        corners: in the last image.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._next = 0
        self.reset()

    def reset(self) -> None:
        """Forget all corners: the next image is the first."""
        self._gray: Pixels | None = None
        self.corners = FollowedCorners(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2)))

    def follow(self, gray: Pixels) -> FollowedCorners:
        """The corners of the image before that are found in this one (H, W), uint8."""
        before, self._gray = self._gray, gray
        if before is None or before.shape != gray.shape or not len(self.corners.ids):
            self.corners = self.corners.chosen(np.zeros(len(self.corners.ids), bool))
            return self.corners
        pixels, found = flow(before, gray, self.corners.pixels_uv)
        ids, before_uv = self.corners.ids, self.corners.pixels_uv
        self.corners = FollowedCorners(ids, pixels, before_uv).chosen(found)
        return self.corners

    def drop(self, ids: Ids) -> None:
        """Follow these corners no longer."""
        self.corners = self.corners.chosen(~np.isin(self.corners.ids, ids))

    def refill(self) -> FollowedCorners:
        """Add new corners in empty cells, drop the newest of crowded ones; all corners then."""
        if self._gray is None:
            return self.corners
        new = _best_of_cells(self._gray, self.corners.pixels_uv, self.count)
        ids = np.arange(self._next, self._next + len(new))
        self._next += len(new)
        nowhere = np.full_like(new, np.nan)
        several = zip(self.corners, (ids, new, nowhere), strict=True)
        self.corners = FollowedCorners(*(np.concatenate(pair) for pair in several))
        most = 3 * self.count // 2
        if len(self.corners.ids) > most:
            crowd = _Grid(self._gray.shape, self.count).crowd(self.corners.pixels_uv)
            least = np.argsort(crowd, kind="stable")[:most]
            self.corners = self.corners.chosen(np.sort(least))
        return self.corners


def flow(
    before: Pixels,
    gray: Pixels,
    pixels_uv: Floats,
    guess_uv: Floats | None = None,
    levels: int = _LEVELS,
    back_levels: int = _BACK_LEVELS,
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Pixels (N, 2) of an image in the next one, and which were found (N,).

    ``guess_uv``: where they may be; ``levels`` of the pyramid beyond the image itself, and those on
    the way back.
    """
    start = pixels_uv.astype(np.float32).reshape(-1, 1, 2)
    options: dict[str, Any] = {"winSize": (PATCH, PATCH), "maxLevel": levels, "criteria": _STOP}
    flags = 0 if guess_uv is None else cv2.OPTFLOW_USE_INITIAL_FLOW
    guess = None if guess_uv is None else guess_uv.astype(np.float32).reshape(-1, 1, 2)
    pursue: Any = cv2.calcOpticalFlowPyrLK
    there, is_there, _ = pursue(before, gray, start, guess, flags=flags, **options)
    options["maxLevel"] = back_levels
    again = {"flags": cv2.OPTFLOW_USE_INITIAL_FLOW, **options}
    back, is_back, _ = pursue(gray, before, there, start.copy(), **again)
    found = (is_there & is_back)[:, 0].astype(bool)
    found &= np.hypot(*(back - start)[:, 0].T) < _RETURN_PX
    pixels: Floats = there[:, 0].astype(np.float64)
    height, width = gray.shape
    found &= (pixels >= _MARGIN).all(axis=1)
    found &= (pixels < [width - _MARGIN, height - _MARGIN]).all(axis=1)
    return pixels, found


class _Grid:
    """Cells of an image, about ``count``."""

    def __init__(self, shape: tuple[int, ...], count: int) -> None:
        height, width = shape[:2]
        self.side = max(int(np.sqrt(height * width / count)), 2 * _MARGIN)
        self.rows, self.columns = height // self.side, width // self.side
        self.top = (height - self.rows * self.side) // 2
        self.left = (width - self.columns * self.side) // 2

    def cells(self, pixels_uv: Floats) -> npt.NDArray[np.intp]:
        """(N,) cells of pixels (N, 2)."""
        at = ((pixels_uv - [self.left, self.top]) // self.side).astype(int)
        at = at.clip(0, [self.columns - 1, self.rows - 1])
        found: npt.NDArray[np.intp] = at[:, 1] * self.columns + at[:, 0]
        return found

    def crowd(self, pixels_uv: Floats) -> npt.NDArray[np.intp]:
        """(N,) numbers of earlier pixels (N, 2) in the same cell."""
        cells = self.cells(pixels_uv)
        order = np.argsort(cells, kind="stable")
        _, starts, counts = np.unique(cells[order], return_index=True, return_counts=True)
        found = np.empty(len(cells), np.intp)
        found[order] = np.arange(len(cells)) - np.repeat(starts, counts)
        return found


def _best_of_cells(gray: Pixels, taken_uv: Floats, count: int) -> Floats:
    """(N, 2) the best corner of each cell of a grid without one.

    Rows of cells, one after the other: so what they need stays in the processor's cache.
    """
    grid = _Grid(gray.shape, count)
    side, rows, columns, top, left = grid.side, grid.rows, grid.columns, grid.top, grid.left
    if not rows or not columns:
        return np.zeros((0, 2))
    taken = taken_uv.astype(int)
    of_row = taken[:, 1] - top
    best, places = np.empty((rows, columns)), np.empty((rows, columns, 2))
    for row in range(rows):
        start = top + row * side
        near = (of_row > row * side - _MARGIN) & (of_row < (row + 1) * side + _MARGIN)
        strip = _strength(gray, start, start + side, taken[near])
        cells = strip[:, left : left + columns * side].reshape(side, columns, side)
        cells = cells.swapaxes(0, 1).reshape(columns, -1)
        at = cells.argmax(axis=1)
        best[row] = cells[np.arange(columns), at]
        places[row, :, 0] = left + np.arange(columns) * side + at % side
        places[row, :, 1] = start + at // side
    occupied = np.zeros(rows * columns, bool)
    occupied[grid.cells(taken_uv)] = True
    least = max(_LEAST_CORNER, _RELATIVE * float(np.quantile(best, 0.9)))
    best_uv: Floats = places[(best > least) & ~occupied.reshape(rows, columns)]
    return best_uv


def _strength(
    gray: Pixels, start: int, end: int, taken: npt.NDArray[np.int_]
) -> npt.NDArray[np.float32]:
    """The least eigenvalue around each pixel of some rows; 0 near pixels (N, 2), and borders."""
    above = min(start, _AROUND)
    found = cv2.cornerMinEigenVal(gray[start - above : end + _AROUND], 3)
    strip = np.asarray(found[above : above + end - start], np.float32)
    strip[:, :_MARGIN], strip[:, -_MARGIN:] = 0, 0
    strip[: max(_MARGIN - start, 0)] = 0
    strip[max(len(gray) - _MARGIN - start, 0) :] = 0
    for x, y in (taken - [0, start]).tolist():
        rows = slice(max(y - _MARGIN, 0), max(y + _MARGIN, 0))
        strip[rows, max(x - _MARGIN, 0) : x + _MARGIN] = 0
    return strip
