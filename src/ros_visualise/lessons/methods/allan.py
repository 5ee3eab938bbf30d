"""Allan deviation: the noise of a sensor's mean, by averaging time."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats

_PER_DECADE = 10
_DECADE = 10
_LEAST_WINDOWS = 4  # smallest number of disjoint pairs of windows
OF_BIAS = 0.664
"""Ratio of the minimum of the deviation to the bias instability: the root of 2 ln 2 / pi."""


def allan_deviation(rates: Floats, period_s: float) -> tuple[Floats, Floats]:
    """Times in seconds, (T,), and the deviation of means over each, (T, C).

    Windows overlap, so that all measurements are used.

    Args:
        rates: (N, C) measurements at equal intervals.
        period_s: interval between them.

    Source: IEEE Std 952-1997, annex C; Riley, Handbook of Frequency Stability Analysis, 2008,
    section 5.2.4.
    """
    largest = len(rates) // _LEAST_WINDOWS
    if largest < 1:
        return np.zeros(0), np.zeros((0, rates.shape[1]))
    count = max(2, int(_PER_DECADE * np.log10(largest)) + 1)
    spans = np.unique(np.rint(np.geomspace(1, largest, count)).astype(int))
    angle = np.concatenate([np.zeros((1, rates.shape[1])), np.cumsum(rates, axis=0)]) * period_s
    found = [_deviation(angle, span, period_s) for span in spans]
    return spans * period_s, np.array(found)


def random_walk(times_s: Floats, deviation: Floats) -> float:
    """Noise density: the white noise in a mean over one second, from the short times.

    White noise falls with the root of the time, N / sqrt(t); N is the geometric mean over the first
    decade.
    """
    is_short = times_s <= times_s[0] * _DECADE
    return float(np.exp(np.mean(np.log(deviation[is_short] * np.sqrt(times_s[is_short])))))


def slope_of(times_s: Floats, deviation: Floats) -> float:
    """Slope of the first decade on logarithmic scales: −0.5 of white noise."""
    is_short = times_s <= times_s[0] * _DECADE
    return float(np.polyfit(np.log(times_s[is_short]), np.log(deviation[is_short]), 1)[0])


def _deviation(angle: Floats, span: int, period_s: float) -> Floats:
    """(C,) Allan deviation for means over ``span`` samples."""
    second = angle[2 * span :] - 2 * angle[span:-span] + angle[: -2 * span]
    deviation: Floats = np.sqrt(np.mean(second**2, axis=0) / 2) / (span * period_s)
    return deviation
