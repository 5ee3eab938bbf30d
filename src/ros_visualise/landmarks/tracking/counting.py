"""Counting of tracks that cross lines and that are in zones, in pixels of the image."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from ros_visualise.core.errors import ParameterError
from ros_visualise.data import Floats
from ros_visualise.landmarks.tracking.tracks import Numbers

_CLEAR = 0.1  # distance from a line, in sides of a box, within which an object is on neither side
_KEPT = 10_000  # ids


@dataclass
class CountingLine:
    """A line from its first point to its second; who crosses it to its right is counted as in.

    Seen from the first point, with v downwards: a line from left to right is crossed ``in`` towards
    the lower side.
    """

    name: str
    points_uv: Floats
    into: int = 0
    out: int = 0
    _from: dict[int, Floats] = field(default_factory=dict)  # id -> last point clearly on a side

    def step(self, ids: Numbers, points_uv: Floats, sides: Floats) -> None:
        """Count the tracks (N,) at these points (N, 2) with boxes of these mean sides (N,)."""
        a, b = self.points_uv
        for id, point, side in zip(ids.tolist(), points_uv, sides.tolist(), strict=True):
            off = _off(a, b, point)
            if abs(off) < _CLEAR * side:
                continue
            before = self._from.pop(id, None)
            self._from[id] = point
            if before is None or (off > 0) == (_off(a, b, before) > 0):
                continue
            if _off(before, point, a) * _off(before, point, b) <= 0:
                self.into += off > 0
                self.out += off < 0
        while len(self._from) > _KEPT:
            del self._from[next(iter(self._from))]

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of tracks that crossed it, by direction."""
        return {"in": self.into, "out": self.out}


@dataclass
class CountingZone:
    """A polygon, with the number of tracks in it, and of those that were in it so far."""

    name: str
    points_uv: Floats
    inside: int = 0
    entered: int = 0
    _seen: dict[int, None] = field(default_factory=dict)

    def step(self, ids: Numbers, points_uv: Floats, sides: Floats) -> None:
        """Count the tracks (N,) at these points (N, 2)."""
        outline = self.points_uv.astype(np.float32)
        within = [
            id
            for id, point in zip(ids.tolist(), points_uv.tolist(), strict=True)
            if cv2.pointPolygonTest(outline, point, False) >= 0
        ]
        self.inside = len(within)
        self.entered += len(set(within) - self._seen.keys())
        self._seen.update(dict.fromkeys(within))
        while len(self._seen) > _KEPT:
            del self._seen[next(iter(self._seen))]

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of tracks that are in it, and that were in it so far."""
        return {"inside": self.inside, "entered": self.entered}


def parse_shapes(text: str, name: str, fewest: int, most: int) -> dict[str, Floats]:
    """Names and points (N, 2) of lines or zones: ``gate: 10,20 300,20; exit: ...``.

    Args:
        text: of the parameter.
        name: of the parameter.
        fewest, most: number of points of each.

    Raises:
        ParameterError: another form.
    """
    found: dict[str, Floats] = {}
    for part in filter(None, map(str.strip, text.split(";"))):
        label, _, rest = part.rpartition(":")
        label = label.strip() or f"{name.rstrip('s')} {len(found) + 1}"
        try:
            points = np.array([[float(x) for x in one.split(",")] for one in rest.split()])
            is_good = points.ndim == 2 and points.shape[1] == 2 and np.isfinite(points).all()
        except ValueError:
            is_good = False
        if not is_good or not fewest <= len(points) <= most or label in found:
            raise ParameterError(
                f"{name}={text!r}: give NAME: U,V U,V with {fewest}"
                f"{'' if most == fewest else ' or more'} points in pixels, several separated by ;"
            )
        found[label] = points
    return found


def _off(a: Floats, b: Floats, point: Floats) -> float:
    """Distance of a point from the line through a and b, positive on its right as v is down."""
    (u, v), (x, y) = b - a, point - a
    return float(u * y - v * x) / max(float(np.hypot(u, v)), 1e-9)
