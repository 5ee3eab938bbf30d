"""Analysis of curves: spectra, one against another, histograms, intervals and rates."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry.thinning import evenly
from ros_visualise.ui.live.curves import SampleStore
from ros_visualise.ui.live.derived import Sampled, aligned

_MOST_SAMPLES = 1 << 20
_BINS = 60
_HUGE = 1e140
_VALUE = "value"
Summary = dict[str, float]


def known(curve: Sampled) -> Sampled:
    """The samples that are finite numbers, with finite squares."""
    is_known = np.abs(curve.values) < _HUGE
    return Sampled(curve.times_s[is_known], curve.values[is_known])


def pairs(x: Sampled, y: Sampled, count: int) -> Floats:
    """Values of one curve against another at the times of the second: (N, 3), x, y and time."""
    rows = np.column_stack([aligned(x, y.times_s).values, y.values, y.times_s])
    return rows[evenly(len(rows), count)] if len(rows) else rows


def spectrum(curve: Sampled, count: int) -> Floats:
    """Amplitudes by frequency, (N, 2): Hz, and in the unit of the curve.

    The samples are interpolated to even steps, their median; without their mean, within a Hann
    window. Of each of ``count`` columns the extremes are kept.
    """
    times_s, values = known(curve)
    steps_s = np.diff(times_s)
    steps_s = steps_s[steps_s > 0]
    if len(steps_s) < 2:
        return np.empty((0, 2))
    length_s = times_s[-1] - times_s[0]
    number = min(round(length_s / float(np.median(steps_s))) + 1, _MOST_SAMPLES)
    even_s = np.linspace(times_s[0], times_s[-1], max(number, 3))
    even = np.interp(even_s, times_s, values)
    window = np.hanning(len(even))
    amplitudes = 2 * np.abs(np.fft.rfft((even - even.mean()) * window)) / window.sum()
    store = SampleStore([_VALUE])
    store.add(np.fft.rfftfreq(len(even), even_s[1] - even_s[0]), amplitudes[:, None])
    return np.column_stack(store.between(_VALUE, 0, np.inf, count))


def histogram(values: Floats) -> tuple[Floats, Summary]:
    """Counts of finite values, (N, 3): both edges of a bin, and its count; and their summary."""
    values = values[np.abs(values) < _HUGE]
    if not len(values):
        return np.empty((0, 3)), {"count": 0}
    low, high = float(values.min()), float(values.max())
    room = max(abs(low), abs(high), 1e-300) * 1e-6
    bins = _BINS if high - low > room else 1
    ends = (low, high) if bins > 1 else (low - room, high + room)
    counts, edges = np.histogram(values, bins, ends)
    summary = {"mean": values.mean(), "median": np.median(values), "deviation": values.std()}
    summary |= {"count": len(values), "min": low, "max": high}
    return np.column_stack([edges[:-1], edges[1:], counts]), {
        n: float(v) for n, v in summary.items()
    }


def intervals(curve: Sampled) -> tuple[Floats, Summary]:
    """The histogram of the times from each message to the next, and its summary, in seconds."""
    return histogram(np.diff(known(curve).times_s))


def rates(curve: Sampled, count: int) -> Floats:
    """Messages per second over time, (N, 2), in ``count`` even steps of at least a second."""
    times_s = known(curve).times_s
    if len(times_s) < 2:
        return np.empty((0, 2))
    length_s = times_s[-1] - times_s[0]
    if not length_s:
        return np.empty((0, 2))
    edges_s = np.linspace(times_s[0], times_s[-1], int(np.clip(length_s, 1, count)) + 1)
    counts = np.diff(np.searchsorted(times_s, edges_s, "right"))
    return np.column_stack([edges_s[1:], counts / np.diff(edges_s)])
