"""Random errors of sensors."""

from __future__ import annotations

import math
import zlib

import numpy as np

from ros_visualise.data import Floats

_NS = 1_000_000_000


def random_of(seed: int, name: str, index: int = 0) -> np.random.Generator:
    """The random numbers of one sensor in a run with that seed."""
    return np.random.default_rng([seed, zlib.crc32(name.encode()), index])


class Interval:
    """Seconds between a sensor's measurements, from their stamps.

    The physics is stepped, so measurements at 60 Hz come after 15 or 20 ms.
    """

    def __init__(self) -> None:
        self._last_ns: int | None = None

    def until(self, stamp_ns: int) -> float:
        """Seconds since the last measurement; 0 for the first."""
        before_ns, self._last_ns = self._last_ns, stamp_ns
        return 0.0 if before_ns is None else (stamp_ns - before_ns) / _NS


class GaussMarkov:
    """Slow errors: first-order Gauss-Markov processes that start in their steady state.

    Args:
        deviation: (N,) standard deviation of each.
        time_s: time constant.

    Source: Gelb, Applied Optimal Estimation, 1974, section 2.4.
    """

    def __init__(self, random: np.random.Generator, deviation: Floats, time_s: float) -> None:
        self._random, self._deviation, self._time_s = random, deviation, time_s
        self._interval = Interval()
        self._errors: Floats = deviation * random.standard_normal(len(deviation))

    def at(self, stamp_ns: int) -> Floats:
        """The errors (N,) at a time, not before the last one."""
        keep = math.exp(-self._interval.until(stamp_ns) / self._time_s)
        kick = math.sqrt(1 - keep**2) * self._random.standard_normal(len(self._errors))
        self._errors = keep * self._errors + kick * self._deviation
        return self._errors


class Episodes:
    """Failures that come and go: at random times, each for a while.

    Args:
        random: source of random numbers.
        every_s: mean time from the end of one to the begin of the next; 0: they never come.
        for_s: mean duration of one.

    Attributes:
        number: of the current one, or of the next.
    """

    def __init__(self, random: np.random.Generator, every_s: float, for_s: float) -> None:
        self._random, self._every_s, self._for_s = random, every_s, for_s
        self._begin_s = self._end_s = math.inf if every_s <= 0 else 0.0
        self.number = 0
        self._draw()

    def active(self, stamp_ns: int) -> bool:
        """True during one; call it with times in order."""
        while stamp_ns / _NS >= self._end_s:
            self._draw()
        return stamp_ns / _NS >= self._begin_s

    def _draw(self) -> None:
        if math.isinf(self._end_s):
            return
        self._begin_s = self._end_s + self._every_s * self._random.exponential()
        self._end_s = self._begin_s + self._for_s * self._random.exponential()
        self.number += 1
