"""One number of a topic's messages over time."""

from __future__ import annotations

import threading
from array import array
from bisect import bisect_left

import numpy as np
import numpy.typing as npt

from ros_visualise.geometry.thinning import extremes

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
        chosen = first + extremes(values[first:last], points)
        return times_s[chosen], values[chosen]
