"""Routes: lines through points, and the carrot that a robot follows along them."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from itertools import accumulate, chain, count, pairwise, repeat, takewhile

from ros_visualise.simulation.attitude import Vector

_CORNER = math.radians(30)


class Route:
    """A line through points.

    Args:
        points: one or more, metres in ``map``; repeated points are skipped.
        closed: the last point leads back to the first.
        yaws: heading at each point, radians; None: along the route.

    Attributes:
        corners: distances along the route at which it turns by more than 30 degrees.
    """

    def __init__(
        self, points: list[Vector], closed: bool = False, yaws: list[float | None] | None = None
    ) -> None:
        yaws = yaws or [None] * len(points)
        kept = [
            0,
            *(i for i in range(1, len(points)) if math.dist(points[i], points[i - 1]) > 1e-6),
        ]
        line = [points[i] for i in kept]
        self.yaws = [yaws[i] for i in kept]
        self.closed = closed and len(line) > 2
        if self.closed and math.dist(line[-1], line[0]) > 1e-6:
            line.append(line[0])
            self.yaws.append(self.yaws[0])
        self.points = line
        self._ends = list(accumulate((math.dist(a, b) for a, b in pairwise(line)), initial=0.0))
        self.length_m = self._ends[-1]
        self.corners = [self._ends[i] for i in self._corners()]
        self.extent_m = max(max(along) - min(along) for along in zip(*line, strict=True))

    def at(self, way_m: float) -> Vector:
        """The point at a distance along the route; a closed route wraps around."""
        i, part = self._locate(way_m)
        a, b = self.points[i], self.points[min(i + 1, len(self.points) - 1)]
        return (
            a[0] + part * (b[0] - a[0]),
            a[1] + part * (b[1] - a[1]),
            a[2] + part * (b[2] - a[2]),
        )

    def yaw_at(self, way_m: float) -> float | None:
        """The heading at the next point after a distance along the route."""
        return self.yaws[min(self._locate(way_m)[0] + 1, len(self.yaws) - 1)]

    def next_point(self, way_m: float) -> tuple[int, int, int]:
        """The next point after a distance along the route, from 1; their number; laps until it."""
        count = len(self.points) - self.closed
        number = min(self._locate(way_m)[0] + 1, len(self.points) - 1)
        laps = int(way_m // self.length_m) if self.closed else 0
        return number % count + 1, count, laps

    def _corners(self) -> Iterator[int]:
        """Indices of the corner points; on a closed route also the first may be one."""
        ways = [tuple(b - a for a, b in zip(*ends, strict=True)) for ends in pairwise(self.points)]
        if self.closed:
            ways.insert(0, ways[-1])
        for number, (before, after) in enumerate(pairwise(ways), start=not self.closed):
            along = sum(a * b for a, b in zip(before, after, strict=True))
            if along < math.cos(_CORNER) * math.hypot(*before) * math.hypot(*after):
                yield number

    def _locate(self, way_m: float) -> tuple[int, float]:
        if self.length_m == 0:
            return 0, 0.0
        way_m = way_m % self.length_m if self.closed else min(max(way_m, 0.0), self.length_m)
        i = min(bisect_right(self._ends, way_m), len(self._ends) - 1) - 1
        return i, (way_m - self._ends[i]) / (self._ends[i + 1] - self._ends[i])


class Carrot:
    """A point on a route, at most the lookahead distance ahead of its follower.

    At the start and at each corner it waits for the follower, so that no corner is cut.

    Args:
        lookahead_m: limited to a third of a closed route's extent, or the carrot would go around
            while the follower stays in the middle.
        laps: number of laps on a closed route; 0: endless.
        tolerance_m: distance at which the follower has arrived.
    """

    def __init__(
        self, route: Route, lookahead_m: float, laps: int = 1, tolerance_m: float = 0.1
    ) -> None:
        self.route = route
        self._lookahead_m = min(lookahead_m, route.extent_m / 3) if route.closed else lookahead_m
        self._tolerance_m = tolerance_m
        endless = route.closed and laps == 0
        self._end_m = math.inf if endless else route.length_m * (laps if route.closed else 1)
        self._stops = self._find_stops()
        self._stop_m = next(self._stops)
        self.way_m = 0.0
        self.point = route.at(0.0)

    @property
    def at_end(self) -> bool:
        """True at the end of the route."""
        return self.way_m >= self._end_m

    @property
    def yaw(self) -> float | None:
        """The desired heading at the carrot."""
        return self.route.yaw_at(self.way_m)

    @property
    def place(self) -> str:
        """Position on the route, in words: the next waypoint, and the lap."""
        number, count, laps = self.route.next_point(self.way_m)
        return f"waypoint {number} of {count}" + (f", lap {laps + 1}" if laps else "")

    def advance(self, follower: Vector, step_m: float) -> Vector:
        """Move by at most one step, within the lookahead distance; returns the new point."""
        away_m = math.dist(self.point, follower)
        if self.way_m >= self._stop_m and away_m <= self._tolerance_m:
            self._stop_m = next(self._stops)
        slack_m = self._lookahead_m - away_m
        if slack_m > 0:
            self.way_m = min(self.way_m + min(step_m, slack_m), self._stop_m)
            self.point = self.route.at(self.way_m)
        return self.point

    def progress_m(self, follower: Vector) -> float:
        """Distance of the follower along the route, slightly less in curves."""
        return self.way_m - math.dist(self.point, follower)

    def _find_stops(self) -> Iterator[float]:
        """Distances along the route where it waits, lap after lap, and finally the end."""
        route = self.route
        laps: Iterable[int] = count() if route.closed and route.corners else (0,)
        corners = (lap * route.length_m + corner for lap in laps for corner in route.corners)
        return chain((0.0,), takewhile(lambda m: m < self._end_m, corners), repeat(self._end_m))
