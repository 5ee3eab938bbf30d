"""What is counted while a graph runs, for the run report and the page."""

from __future__ import annotations

import time
from collections import Counter, deque
from typing import Any

import numpy as np

from ros_visualise.runtime.report import NodeReport

_KEPT = 4096
"""How many of the newest times are kept: rates and percentiles are taken from them."""


class TopicStats:
    """Counts one topic's messages and tells their rate, by their stamps and by the wall clock."""

    def __init__(self) -> None:
        self.messages = 0
        self._wall = _Rate()
        self._stamps = _Rate()
        self._epoch = 0

    def count(self, stamp_ns: int, epoch: int) -> None:
        """One message of that stamp passes; between two epochs no time has passed."""
        self.messages += 1
        if epoch != self._epoch:
            self._epoch = epoch
            self._stamps.times.clear()
        self._wall.count(time.monotonic_ns())
        self._stamps.count(stamp_ns)

    def rates(self, window_s: float | None) -> tuple[float | None, float | None]:
        """Hz by the stamps and by the wall clock, of the whole run or of the last seconds."""
        if window_s is None:
            return self._stamps.mean(), self._wall.mean()
        start = time.monotonic_ns() - int(window_s * 1e9)
        recent = sum(1 for t in self._wall.times.copy() if t >= start)
        return self._stamps.mean_of_last(recent), round(recent / window_s, 2)


class _Rate:
    """The mean rate of a series of times; repeated and late ones are left out."""

    def __init__(self) -> None:
        self.times: deque[int] = deque(maxlen=_KEPT)
        self._steps = 0
        self._span_ns = 0

    def count(self, time_ns: int) -> None:
        if self.times and time_ns > self.times[-1]:
            self._steps += 1
            self._span_ns += time_ns - self.times[-1]
        self.times.append(time_ns)

    def mean(self) -> float | None:
        return _hz(self._steps, self._span_ns)

    def mean_of_last(self, count: int) -> float | None:
        steps = np.diff(np.array(self.times.copy(), np.int64)[-max(count, 1) :])
        return _hz(int((steps > 0).sum()), int(steps[steps > 0].sum()))


class NodeStats:
    """Counts what one node received, processed and dropped, and how long it took."""

    def __init__(self) -> None:
        self.received = 0
        self.processed = 0
        self.dropped: Counter[str] = Counter()
        self._latencies_ns: deque[int] = deque(maxlen=_KEPT)
        self._steps_ns: deque[int] = deque(maxlen=_KEPT)

    def answered(self, arrival_ns: int, started_ns: int) -> None:
        """The node is done with a message that the source let go at ``arrival_ns`` (monotonic)."""
        now_ns = time.monotonic_ns()
        self.processed += 1
        self._latencies_ns.append(now_ns - arrival_ns)
        self._steps_ns.append(now_ns - started_ns)

    def report(self) -> NodeReport:
        """Counts and latencies."""
        latencies_ms = np.array(self._latencies_ns.copy()) / 1e6
        steps_ms = np.array(self._steps_ns.copy()) / 1e6
        return NodeReport(
            self.received,
            self.processed,
            dict(self.dropped),
            p50_ms=_percentile(latencies_ms, 50),
            p99_ms=_percentile(latencies_ms, 99),
            step_ms=_percentile(steps_ms, 50),
        )


def _hz(steps: int, span_ns: int) -> float | None:
    return round(steps / span_ns * 1e9, 3) if span_ns else None


def _percentile(values_ms: Any, percent: float) -> float | None:
    return round(float(np.percentile(values_ms, percent)), 3) if len(values_ms) else None
