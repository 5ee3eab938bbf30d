"""What is counted while a graph runs, for the run report and the page."""

from __future__ import annotations

import time
from collections import Counter
from typing import Any

import numpy as np
import numpy.typing as npt

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
            self._stamps.begin_anew()
        self._wall.count(time.monotonic_ns())
        self._stamps.count(stamp_ns)

    def rates(self, window_s: float | None) -> tuple[float | None, float | None]:
        """Hz by the stamps and by the wall clock, of the whole run or of the last seconds."""
        if window_s is None:
            return self._stamps.mean(), self._wall.mean()
        now = time.monotonic_ns()
        newest = self._wall.newest()
        recent = int((newest >= now - int(window_s * 1e9)).sum())
        if recent == _KEPT:  # there were more in that time: the rate is that of the newest
            window_s = max((now - int(newest[0])) / 1e9, 1e-9)
        return self._stamps.mean_of_last(recent), round(recent / window_s, 2)


_LARGEST = 2**63 - 1  # stamps of damaged messages may be any number


class _Newest:
    """The newest of many numbers, in room that is taken at once and never grows."""

    def __init__(self) -> None:
        self._room: npt.NDArray[np.int64] = np.full(_KEPT, 0, np.int64)
        self._count = 0

    def add(self, number: int) -> None:
        self._room[self._count % _KEPT] = min(max(number, -_LARGEST), _LARGEST)
        self._count += 1

    def clear(self) -> None:
        self._count = 0

    def all(self) -> npt.NDArray[np.int64]:
        """In their order; of one that is added meanwhile, the oldest may be it already."""
        count = self._count
        whole = self._room[:count] if count <= _KEPT else np.roll(self._room, -count)
        return whole.astype(np.int64)


class _Rate:
    """The mean rate of a series of times; repeated and late ones are left out."""

    def __init__(self) -> None:
        self._times = _Newest()
        self._last: int | None = None
        self._steps = 0
        self._span_ns = 0

    def count(self, time_ns: int) -> None:
        if self._last is not None and time_ns > self._last:
            self._steps += 1
            self._span_ns += time_ns - self._last
        self._last = time_ns
        self._times.add(time_ns)

    def begin_anew(self) -> None:
        """No time passes to the next one."""
        self._times.clear()
        self._last = None

    def newest(self) -> npt.NDArray[np.int64]:
        return self._times.all()

    def mean(self) -> float | None:
        return _hz(self._steps, self._span_ns)

    def mean_of_last(self, count: int) -> float | None:
        steps = np.diff(self.newest()[-max(count, 1) :])
        return _hz(int((steps > 0).sum()), int(steps[steps > 0].sum()))


class NodeStats:
    """Counts what one node received, processed and dropped, and how long it took."""

    def __init__(self) -> None:
        self.received = 0
        self.processed = 0
        self.errors = 0
        self.dropped: Counter[str] = Counter()
        self._latencies_ns = _Newest()
        self._steps_ns = _Newest()

    def answered(self, arrival_ns: int, started_ns: int) -> None:
        """The node is done with a message that the source let go at ``arrival_ns`` (monotonic)."""
        now_ns = time.monotonic_ns()
        self.processed += 1
        self._latencies_ns.add(now_ns - arrival_ns)
        self._steps_ns.add(now_ns - started_ns)

    def report(self) -> NodeReport:
        """Counts and latencies."""
        latencies_ms = self._latencies_ns.all() / 1e6
        steps_ms = self._steps_ns.all() / 1e6
        return NodeReport(
            self.received,
            self.processed,
            dict(self.dropped),
            p50_ms=_percentile(latencies_ms, 50),
            p99_ms=_percentile(latencies_ms, 99),
            step_ms=_percentile(steps_ms, 50),
            errors=self.errors,
        )


def _hz(steps: int, span_ns: int) -> float | None:
    return round(steps / span_ns * 1e9, 3) if span_ns else None


def _percentile(values_ms: Any, percent: float) -> float | None:
    return round(float(np.percentile(values_ms, percent)), 3) if len(values_ms) else None
