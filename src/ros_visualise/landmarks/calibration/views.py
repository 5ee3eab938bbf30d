"""Views of a board: which ones to keep, their coverage of the image, and what is missing.

The four measures and their thresholds are those of ROS's cameracalibrator
(camera_calibration/calibrator.py, `get_parameters` and `compute_goodenough`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.calibration.boards import Board, points_xy
from ros_visualise.landmarks.calibration.finding import BoardPoints
from ros_visualise.vision.reshape import Size

MEASURES = ("x", "y", "size", "skew")
_ENOUGH = (0.7, 0.7, 0.4, 0.5)
_ALIKE = 0.05
"""Views that differ by less are duplicates: more of them only make the result look too certain."""
_GRID = (12, 9)
"""Columns and rows of the coverage map."""
_THIRDS = (("upper left corner", "upper border", "upper right corner"),
           ("left border", "middle", "right border"),
           ("lower left corner", "lower border", "lower right corner"))  # fmt: skip


@dataclass(frozen=True, eq=False)
class BoardView:
    """A board found in an image.

    Args:
        name: of the image.
        board: found in it.
        points: the points found.
        size: width and height of the image.
    """

    name: str
    board: Board
    points: BoardPoints
    size: Size

    @cached_property
    def points_xyz(self) -> Floats:
        """(N, 3), metres, in the board's frame."""
        flat = points_xy(self.board)[self.points.numbers]
        return np.column_stack([flat, np.zeros(len(flat))])

    @cached_property
    def bends(self) -> Floats:
        """(N, 3) heights of the points, metres, of a board bent along x, along y, and twisted.

        Each by half the board's diagonal at that distance from its middle.
        """
        flat = points_xy(self.board)
        middle = (flat.min(axis=0) + flat.max(axis=0)) / 2
        half = float(np.linalg.norm(flat.max(axis=0) - middle))
        x, y = ((self.points_xyz[:, :2] - middle) / half).T
        heights: Floats = half * np.column_stack([x * x, y * y, x * y])
        return heights

    def bent_xyz(self, bend: Floats) -> Floats:
        """(N, 3), metres, the points of a board with that bend (3,)."""
        return self.points_xyz + np.outer(self.bends @ bend, [0, 0, 1])

    @cached_property
    def measures(self) -> Floats:
        """(4,), each from 0 to 1: x, y, size and skew of the board in the image."""
        (top_left, top_right, bottom_right, _), area = self._outline
        width, height = self.size
        border = np.sqrt(area)
        middle = self.points.uv.mean(axis=0)
        x = (middle[0] - border / 2) / max(width - border, 1)
        y = (middle[1] - border / 2) / max(height - border, 1)
        one, other = top_left - top_right, bottom_right - top_right
        cosine = one @ other / max(float(np.linalg.norm(one) * np.linalg.norm(other)), 1e-9)
        skew = 2 * abs(np.pi / 2 - np.arccos(np.clip(cosine, -1, 1)))
        size = border / np.sqrt(width * height)
        return np.clip(np.array([x, y, size, skew], np.float64), 0, 1)

    @cached_property
    def place(self) -> Floats:
        """(6,) position and tilt of the board; the distance between two measures similarity."""
        corners, _ = self._outline
        sides = np.linalg.norm(corners - np.roll(corners, -1, axis=0), axis=1)
        tilts = np.log(
            np.maximum(sides[:2], 1) / np.maximum(sides[2:], 1)
        )  # positive if the first side is nearer
        turn = np.arctan2(*(corners[1] - corners[0])[::-1]) / np.pi
        return np.array([*self.measures, *tilts, turn])

    @cached_property
    def _outline(self) -> tuple[Floats, float]:
        """The pattern's corners (4, 2), clockwise from the top left, and their area, pixels."""
        xy = self.points_xyz[:, :2]
        H, _ = cv2.findHomography(xy, self.points.uv)
        low, high = xy.min(axis=0), xy.max(axis=0)
        frame = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
        corners = frame if H is None else cv2.perspectiveTransform(frame[:, None], H)[:, 0]
        return np.asarray(corners, np.float64), float(cv2.contourArea(corners.astype(np.float32)))


class Gallery:
    """A limited number of distinct views.

    Args:
        most: largest number; of the two most similar views, one is dropped.
    """

    def __init__(self, most: int = 60) -> None:
        self._most = most
        self.views: list[BoardView] = []
        self.alike = 0
        """Number of views dropped as similar to others."""

    def offer(self, view: BoardView) -> bool:
        """Keep the view if it is distinct; True if kept."""
        of_its_kind = [
            one for one in self.views if (one.board, one.size) == (view.board, view.size)
        ]
        if any(self._distance(view, other) < _ALIKE for other in of_its_kind):
            self.alike += 1
            return False
        self.views.append(view)
        if len(self.views) > self._most:
            gone = self._most_alike()
            self.alike += 1
            return self.views.pop(gone) is not view
        return True

    def _distance(self, one: BoardView, other: BoardView) -> float:
        return float(np.abs(one.place - other.place).sum())

    def _most_alike(self) -> int:
        places = np.array([view.place for view in self.views])
        apart = np.abs(places[:, None] - places).sum(axis=2) + np.diag([np.inf] * len(places))
        return int(apart.min(axis=1).argmin())


@dataclass(frozen=True, eq=False)
class Coverage:
    """The coverage of views.

    Attributes:
        bars: by measure, from 0 to 1, which is enough.
        cells: (rows, columns) number of points in each part of the image.
        advice: what to do next, one line; empty if all is covered.
    """

    bars: dict[str, float]
    cells: Floats
    advice: str

    @property
    def share(self) -> float:
        """Fraction of the parts of the image with points."""
        return float((self.cells > 0).mean())


def cover(views: list[BoardView], size: Size) -> Coverage:
    """The coverage of an image of that size."""
    cells = np.zeros(_GRID[::-1])
    if not views:
        return Coverage(
            dict.fromkeys(MEASURES, 0.0), cells, "hold the board in front of the camera"
        )
    uv = np.vstack([view.points.uv for view in views])
    edges = [
        np.linspace(-0.5, side - 0.5, count + 1) for side, count in zip(size, _GRID, strict=True)
    ]
    cells = np.histogram2d(uv[:, 1], uv[:, 0], bins=edges[::-1])[0]
    measured = np.array([view.measures for view in views])
    low, high = measured.min(axis=0), measured.max(axis=0)
    low[2:] = 0  # small or frontal boards add nothing
    bars = np.minimum((high - low) / _ENOUGH, 1).tolist()
    return Coverage(dict(zip(MEASURES, bars, strict=True)), cells, _advise(bars, low, high, cells))


def _advise(bars: list[float], low: Floats, high: Floats, cells: Floats) -> str:
    x, y, size, skew = bars
    if skew < 1:
        return "tilt the board: left and right, forward and back"
    if x < 1:
        side = "left" if low[0] > 1 - high[0] else "right"
        return f"hold the board closer to the {side} border"
    if y < 1:
        side = "upper" if low[1] > 1 - high[1] else "lower"
        return f"hold the board closer to the {side} border"
    if size < 1:
        return "hold the board closer, so that it fills the image"
    thirds = [
        [part.sum() for part in np.array_split(band, 3, 1)] for band in np.array_split(cells, 3)
    ]
    empty = np.argwhere(np.array(thirds) == 0)
    return f"move the board to the {_THIRDS[empty[0][0]][empty[0][1]]}" if len(empty) else ""
