"""Counters of a running graph: messages, rates, drops and latencies of its topics and nodes."""

from __future__ import annotations

import time
from collections import Counter

import numpy as np
import numpy.typing as npt

from ros_visualise.runtime.report import NodeReport, TopicReport

_KEPT = 4096
"""Newest times kept, from which rates and percentiles are computed."""

_JUMP_NS = 1_000_000_000  # stamps on a topic that go back by less are late

_LARGEST = 2**63 - 1  # damaged messages may have any number as a stamp


class TopicCounter:
    """Messages of one topic, and their rates by stamps and by the wall clock."""

    def __init__(self) -> None:
        self.messages = 0
        self._wall = _Rate()
        self._stamps = _Rate()
        self._epoch = 0

    def count(self, stamp_ns: int, epoch: int) -> None:
        """Count one message; no time passes between two epochs."""
        self.messages += 1
        if epoch != self._epoch:
            self._epoch = epoch
            self._stamps.restart()
        self._wall.count(time.monotonic_ns())
        self._stamps.count(stamp_ns)

    def report(self, type_name: str, window_s: float | None) -> TopicReport:
        """Counts and rates, of the whole run or of the last seconds."""
        return TopicReport(type_name, self.messages, *self.rates(window_s))

    def rates(self, window_s: float | None) -> tuple[float | None, float | None]:
        """Hz by the stamps and by the wall clock, of the whole run or of the last seconds."""
        if window_s is None:
            return self._stamps.mean(), self._wall.mean()
        now = time.monotonic_ns()
        newest = self._wall.times.newest()
        recent = int((newest >= now - int(window_s * 1e9)).sum())
        if recent == _KEPT:  # the window holds more than that: use the span of those kept
            window_s = max((now - int(newest[0])) / 1e9, 1e-9)
        return self._stamps.mean_of_last(recent), round(recent / window_s, 2)


class NodeCounter:
    """Messages that one node received, processed and dropped, and the time that it took."""

    def __init__(self) -> None:
        self.received = 0
        self.processed = 0
        self.errors = 0
        self.dropped: Counter[str] = Counter()
        self._latencies_ns = _Ring()
        self._steps_ns = _Ring()

    def answered(self, arrival_ns: int, started_ns: int) -> None:
        """Count a processed message, by its arrival and the start of the step (monotonic)."""
        now_ns = time.monotonic_ns()
        self.processed += 1
        self._latencies_ns.add(now_ns - arrival_ns)
        self._steps_ns.add(now_ns - started_ns)

    def report(self) -> NodeReport:
        """Counts and latencies."""
        return NodeReport(
            self.received,
            self.processed,
            dict(self.dropped),
            p50_ms=self._latencies_ns.percentile_ms(50),
            p99_ms=self._latencies_ns.percentile_ms(99),
            step_ms=self._steps_ns.percentile_ms(50),
            errors=self.errors,
        )


class _Ring:
    """The newest of many integers, in memory that never grows."""

    def __init__(self) -> None:
        self._values: npt.NDArray[np.int64] = np.full(_KEPT, 0, np.int64)
        self._count = 0

    def add(self, value: int) -> None:
        self._values[self._count % _KEPT] = min(max(value, -_LARGEST), _LARGEST)
        self._count += 1

    def clear(self) -> None:
        self._count = 0

    def newest(self) -> npt.NDArray[np.int64]:
        """The values in order; one added meanwhile may already replace the oldest."""
        count = self._count
        return self._values[:count].copy() if count <= _KEPT else np.roll(self._values, -count)

    def percentile_ms(self, percent: float) -> float | None:
        values_ms = self.newest() / 1e6
        return round(float(np.percentile(values_ms, percent)), 3) if len(values_ms) else None


class _Rate:
    """The mean rate of a series of times; repeated ones and jumps back are ignored.

    Times that are late by less, as from several publishers on one topic, count.
    """

    def __init__(self) -> None:
        self.times = _Ring()
        self._last: int | None = None
        self._steps = 0
        self._span_ns = 0

    def count(self, time_ns: int) -> None:
        step_ns = 0 if self._last is None else time_ns - self._last
        if step_ns and step_ns > -_JUMP_NS:
            self._steps += 1
            self._span_ns += step_ns
        self._last = time_ns
        self.times.add(time_ns)

    def restart(self) -> None:
        """No time passes to the next one."""
        self.times.clear()
        self._last = None

    def mean(self) -> float | None:
        return _hz(self._steps, self._span_ns)

    def mean_of_last(self, count: int) -> float | None:
        steps = np.diff(self.times.newest()[-max(count, 1) :])
        steps = steps[(steps != 0) & (steps > -_JUMP_NS)]
        return _hz(len(steps), int(steps.sum()))


def _hz(steps: int, span_ns: int) -> float | None:
    return round(steps / span_ns * 1e9, 3) if span_ns > 0 else None
