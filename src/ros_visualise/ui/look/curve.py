"""One number of a topic's messages over time."""

from __future__ import annotations

import threading
from array import array
from bisect import bisect_left

import numpy as np
import numpy.typing as npt

_MOST = 5_000_000

Numbers = npt.NDArray[np.float64]


class Curve:
    """Values in order of time; it may be called from any thread.

    Attributes:
        share: how much of it is there, 0 to 1; None: it grows as messages come.
        error: why it ends early; empty if it does not.
    """

    def __init__(self, share: float | None) -> None:
        self.share = share
        self.error = ""
        self._times_s, self._values = array("d"), array("d")
        self._lock = threading.Lock()

    def add(self, time_s: float, value: float) -> None:
        """Go on; what was there at that time and later goes, as time has jumped back."""
        with self._lock:
            if self._times_s and time_s < self._times_s[-1]:
                kept = bisect_left(self._times_s, time_s)
                del self._times_s[kept:], self._values[kept:]
            if len(self._times_s) < _MOST:
                self._times_s.append(time_s)
                self._values.append(value)

    def between(self, start_s: float, end_s: float, points: int) -> tuple[Numbers, Numbers]:
        """Times and values from one time to another, with one of either side.

        Args:
            start_s, end_s: seconds.
            points: so many at most: of each stretch the lowest and the highest are kept.
        """
        with self._lock:
            times_s, values = np.array(self._times_s), np.array(self._values)
        first = max(int(np.searchsorted(times_s, start_s)) - 1, 0)
        last = int(np.searchsorted(times_s, end_s, "right")) + 1
        return thin(times_s[first:last], values[first:last], points)


def thin(times_s: Numbers, values: Numbers, points: int) -> tuple[Numbers, Numbers]:
    """At most so many of the points (N,): of each stretch its lowest and its highest value.

    No peak is lost. What is no number is left out where a stretch holds numbers too.
    """
    if len(values) <= points:
        return times_s, values
    stretches = max(points // 2, 1)
    edges = np.linspace(0, len(values), stretches + 1).astype(np.intp)[:-1]
    low = _extremes(np.where(np.isfinite(values), values, np.inf), edges)
    high = _extremes(np.where(np.isfinite(values), -values, np.inf), edges)
    kept = np.unique(np.concatenate([low, high]))
    return times_s[kept], values[kept]


def _extremes(values: Numbers, edges: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """Where the lowest value of each stretch is; each begins at an edge and ends at the next."""
    parts = np.split(np.arange(len(values)), edges[1:])
    return np.array([part[np.argmin(values[part])] for part in parts], np.intp)
