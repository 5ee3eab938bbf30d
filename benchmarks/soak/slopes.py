"""The slope of a series whose noise remembers: how fast something grows, and how sure that is.

What a program takes of memory goes up and down in steps that last, so that its samples are not
independent, and least squares over all of them would be far too sure. Here the line is fitted to
the means of `BLOCKS` blocks of equal length: noise that is remembered for less than a block
averages out, and the scatter of the means about the line says how sure the slope is (Student's t).
Noise that lasts longer than a block makes a slope look surer than it is, so that growth may be seen
where there is none; it does not hide growth.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

BLOCKS = 12
_T = 2.228  # 97.5% of Student's t with BLOCKS - 2 degrees of freedom


class Slope(NamedTuple):
    """A slope per hour; it is within ``half_width`` of the truth with 95 %."""

    per_hour: float
    half_width: float

    @property
    def least(self) -> float:
        """The lower end of the interval."""
        return self.per_hour - self.half_width

    def __str__(self) -> str:
        return f"{self.per_hour:+.2f} ± {self.half_width:.2f}"


def slope_of(times_s: Sequence[float], values: Sequence[float]) -> Slope | None:
    """The slope of a series; None of one that is too short."""
    if len(times_s) < 2 * BLOCKS:
        return None
    hours = np.asarray(times_s) / 3600
    means = [
        (hours[block].mean(), np.asarray(values, float)[block].mean())
        for block in np.array_split(np.arange(len(hours)), BLOCKS)
    ]
    x, y = np.array(means).T
    x = x - x.mean()
    per_hour = float(x @ y / (x @ x))
    left = y - y.mean() - per_hour * x
    error = float(np.sqrt(left @ left / (BLOCKS - 2) / (x @ x)))
    return Slope(per_hour, _T * error)
