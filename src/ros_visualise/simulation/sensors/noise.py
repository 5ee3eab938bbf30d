"""Random errors, as they are of sensors."""

from __future__ import annotations

import math
import zlib

import numpy as np

from ros_visualise.data import Floats


def random_of(seed: int, name: str, index: int = 0) -> np.random.Generator:
    """The random numbers of one sensor in a run of that seed."""
    return np.random.default_rng([seed, zlib.crc32(name.encode()), index])


class Drift:
    """Slow errors: first-order Gauss-Markov processes that start in their steady state.

    Args:
        deviation: (N,) of each.
        time_s: in which they forget 63 % of what they were.
        period_s: between two steps.

    Source: Gelb, Applied Optimal Estimation, 1974, section 2.4.
    """

    def __init__(
        self, random: np.random.Generator, deviation: Floats, time_s: float, period_s: float
    ) -> None:
        self._random = random
        self._keep = math.exp(-period_s / time_s)
        self._kick = deviation * math.sqrt(1 - self._keep**2)
        self._errors: Floats = deviation * random.standard_normal(len(deviation))

    def step(self) -> Floats:
        """The errors (N,), one period later."""
        now = self._errors
        self._errors = self._keep * now + self._kick * self._random.standard_normal(len(now))
        return now
