"""Ways to go: lines through points, and a carrot that is led along them."""

from __future__ import annotations

import math
from bisect import bisect_right
from itertools import accumulate, pairwise

from ros_visualise.simulation.attitude import Vector


class Route:
    """A line through points.

    Args:
        points: two or more, metres in ``map``; equal ones that follow each other count once.
        closed: it goes on from the last to the first.
        yaws: the heading to arrive at each point with, radians; None: along the way.
    """

    def __init__(
        self,
        points: list[Vector],
        closed: bool = False,
        yaws: list[float | None] | None = None,
    ) -> None:
        yaws = yaws or [None] * len(points)
        kept = [
            0,
            *(i for i in range(1, len(points)) if math.dist(points[i], points[i - 1]) > 1e-6),
        ]
        line = [points[i] for i in kept]
        self.yaws = [yaws[i] for i in kept]
        self.closed = closed and len(line) > 2
        if self.closed:
            line.append(line[0])
            self.yaws.append(self.yaws[0])
        self.points = line
        self._ends = list(accumulate((math.dist(a, b) for a, b in pairwise(line)), initial=0.0))
        self.length_m = self._ends[-1]
        self.extent_m = max(max(along) - min(along) for along in zip(*line, strict=True))

    def at(self, way_m: float) -> Vector:
        """The point that far along it; on a closed one, around and around."""
        i, part = self._locate(way_m)
        a, b = self.points[i], self.points[min(i + 1, len(self.points) - 1)]
        return (
            a[0] + part * (b[0] - a[0]),
            a[1] + part * (b[1] - a[1]),
            a[2] + part * (b[2] - a[2]),
        )

    def yaw_at(self, way_m: float) -> float | None:
        """The heading asked for at the next point from there on."""
        return self.yaws[min(self._locate(way_m)[0] + 1, len(self.yaws) - 1)]

    def _locate(self, way_m: float) -> tuple[int, float]:
        if self.length_m == 0:
            return 0, 0.0
        way_m = way_m % self.length_m if self.closed else min(max(way_m, 0.0), self.length_m)
        i = min(bisect_right(self._ends, way_m), len(self._ends) - 1) - 1
        return i, (way_m - self._ends[i]) / (self._ends[i + 1] - self._ends[i])


class Carrot:
    """A point led along a route, never further than ``leash_m`` ahead of who follows it.

    Args:
        leash_m: no more than a third of how far a closed route reaches, lest it be gone around
            with the follower in its middle.
        laps: how often a closed route is gone around; 0: without an end.
    """

    def __init__(self, route: Route, leash_m: float, laps: int = 1) -> None:
        self.route = route
        self._leash_m = min(leash_m, route.extent_m / 3) if route.closed else leash_m
        endless = route.closed and laps == 0
        self._end_m = math.inf if endless else route.length_m * (laps if route.closed else 1)
        self.way_m = 0.0
        self.point = route.at(0.0)

    @property
    def at_end(self) -> bool:
        """The carrot is where the way ends."""
        return self.way_m >= self._end_m

    @property
    def yaw(self) -> float | None:
        """The heading asked for there."""
        return self.route.yaw_at(self.way_m)

    def lead(self, follower: Vector, step_m: float) -> Vector:
        """Go on by a step, or less where the leash gets short; returns the new point."""
        slack_m = self._leash_m - math.dist(self.point, follower)
        if slack_m > 0:
            self.way_m = min(self.way_m + min(step_m, slack_m), self._end_m)
            self.point = self.route.at(self.way_m)
        return self.point
