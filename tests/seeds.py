"""How often tests of statistics repeat what is random: with some seeds, or with SEEDS=all.

Bounds of a mean follow from the number of runs: fewer of them allow more.
"""

import math
import os

ALL = os.environ.get("SEEDS") == "all"


def runs(usual: int, of: int) -> int:
    """The number of runs: the usual one, or with SEEDS=all the larger one."""
    return of if ALL else usual


def mean_band(size: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Where the mean of ``count`` chi squared of ``size`` numbers lies, 95 times of 100.

    Args:
        z: deviations of a normal distribution to each side; 3 for 99.7 times of 100.

    Source: Wilson and Hilferty, The distribution of chi-square, 1931.
    """
    k = size * count
    low, high = (size * (1 - 2 / (9 * k) + at * math.sqrt(2 / (9 * k))) ** 3 for at in (-z, z))
    return low, high
