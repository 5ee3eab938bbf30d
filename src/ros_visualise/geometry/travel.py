"""Distance and speeds from a stream of poses."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

_NS = 1_000_000_000
_WINDOW_NS = _NS
"""Speeds are those over a second: stamps that are 10 ms off change them by 1%."""
_GRAIN_NS = _WINDOW_NS // 100
"""Least time between the starts of two windows, so that they are few."""


@dataclass(frozen=True)
class TravelSummary:
    """Metres, seconds and metres per second; speeds are None where no time passed."""

    length_m: float
    duration_s: float
    mean_mps: float | None
    top_mps: float | None


class Travel:
    """Distance, duration and speeds, in constant time and memory for each pose.

    The distance is the sum of straight lines between positions. The top speed is the largest
    distance within a window of at least one second, divided by the window's duration, so that
    neither jitter of stamps nor two poses of one stamp give a false speed. It is never below the
    mean speed.
    """

    def __init__(self) -> None:
        self.length_m = 0.0
        self._top_mps = 0.0
        self._position: tuple[float, ...] | None = None
        self._first_ns = self._last_ns = 0
        self._begins: deque[tuple[int, float]] = deque()

    def add(self, stamp_ns: int, position_xyz: Sequence[float]) -> None:
        """Add a position (3,), metres, at a time not before the last."""
        position = tuple(position_xyz)
        if self._position is None:
            self._first_ns = stamp_ns
        else:
            self.length_m += math.dist(position, self._position)
        self._position, self._last_ns = position, stamp_ns
        self._measure()

    def summary(self) -> TravelSummary:
        """Distance and speeds so far."""
        duration_s = (self._last_ns - self._first_ns) / _NS
        if duration_s <= 0:
            return TravelSummary(self.length_m, 0.0, None, None)
        mean = self.length_m / duration_s
        return TravelSummary(self.length_m, duration_s, mean, max(self._top_mps, mean))

    def _measure(self) -> None:
        begins, now_ns = self._begins, self._last_ns
        if not begins or now_ns - begins[-1][0] >= _GRAIN_NS:
            begins.append((now_ns, self.length_m))
        while len(begins) > 1 and now_ns - begins[1][0] >= _WINDOW_NS:
            begins.popleft()
        begin_ns, length_m = begins[0]
        if now_ns - begin_ns >= _WINDOW_NS:
            speed = (self.length_m - length_m) / (now_ns - begin_ns) * _NS
            self._top_mps = max(self._top_mps, speed)
