"""The last half second: events by time, and the belief after each.

An event that comes late is put in at its own time, and the beliefs after it are made again. One
that is older than the window comes too late, and is counted.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections import Counter
from typing import NamedTuple

import numpy as np

from ros_visualise.estimation.belief import Belief
from ros_visualise.estimation.camera_view import CameraView
from ros_visualise.estimation.filter import Event, Filter, OdometryEvent, StatedPose
from ros_visualise.estimation.rivalry import ImuIsWrong
from ros_visualise.estimation.settings import NavigatorSettings

_MOST_WAITING = 100  # events, if the odometry has stopped

Key = tuple[int, str, int]


class _Entry(NamedTuple):
    key: Key
    event: Event


class _Known(NamedTuple):
    key: Key
    belief: Belief


class EventWindow:
    """Events of the last seconds, and beliefs.

    Attributes:
        filter: what makes beliefs of events.
        dropped: numbers of events dropped, by reason.
        late_s: by sensor, the age of the last one dropped as too old.
    """

    def __init__(self, filter: Filter, first: Belief) -> None:
        self.filter = filter
        self.dropped: Counter[str] = Counter()
        self.late_s: dict[str, float] = {}
        self._known = [_Known((-(1 << 62), "", 0), first)]
        self._entries: list[_Entry] = []
        self._count = 0

    def configure(self, settings: NavigatorSettings) -> None:
        """Change the settings; errors with another prior are estimated anew."""
        before = self.filter.settings.priors()
        pairs = zip(before, settings.priors(), strict=False)
        changed = [new for old, new in pairs if (old[1] != new[1]).any()]
        self.filter.settings = settings
        for n, (key, belief) in enumerate(self._known):
            state, new = belief.state.copy(), belief.copy()
            for rows, variances in changed:
                state.forget(rows)
                state.inflate(rows, np.diag(variances))
            new.state = state
            self._known[n] = _Known(key, new)

    @property
    def newest(self) -> Belief:
        """The belief after the last event that could be applied."""
        return self._known[-1].belief

    def at(self, stamp_ns: int) -> Belief | None:
        """The belief after the odometry of a time; None if it is not in the window."""
        for _, belief in reversed(self._known):
            if belief.stamp_ns == stamp_ns:
                return belief
        return None

    def add(self, event: Event) -> bool:
        """Put an event in at its time; False if that is older than the window."""
        self._count += 1
        key = event.stamp_ns, _kind(event), self._count
        if key <= self._known[0].key:
            self._drop_late(_name(event), event.stamp_ns)
            return False
        insort(self._entries, _Entry(key, event), key=lambda one: one.key)
        if isinstance(event, OdometryEvent):
            before_ns = self.filter.odometer.before(event.stamp_ns)
            self.redo(event.stamp_ns if before_ns is None else before_ns)
        while self._known[-1].key > key:
            self._known.pop()
        return True

    def is_past(self, name: str, stamp_ns: int) -> bool:
        """True if a measurement of that time comes too late, which is counted."""
        is_past = stamp_ns < self._known[0].key[0]
        if is_past:
            self._drop_late(name, stamp_ns)
        return is_past

    def _drop_late(self, name: str, stamp_ns: int) -> None:
        self.dropped[f"{name}: older than the parameter 'delay' allows"] += 1
        newest_ns = self.filter.odometer.newest_ns
        if newest_ns is not None:
            self.late_s = {**self.late_s, name: (newest_ns - stamp_ns) / 1e9}

    def redo(self, after_ns: int) -> None:
        """Make the beliefs after a time again: more is known of the motion since."""
        while len(self._known) > 1 and self._known[-1].key[0] > after_ns:
            self._known.pop()

    def run(self) -> None:
        """Apply all events that can be applied.

        An event that fails is dropped, as it would fail again and hold up all later ones; the
        error is raised.
        """
        while True:
            after = bisect_right(self._entries, self._known[-1].key, key=lambda one: one.key)
            if after == len(self._entries):
                break
            key, event = self._entries[after]
            if not self.filter.reaches(self.newest, event.stamp_ns):
                self._limit_waiting(after)
                break
            try:
                self._known.append(_Known(key, self.filter.after(self.newest, event)))
            except ImuIsWrong as wrong:
                self._go_back(wrong.belief)
            except Exception:
                del self._entries[after]
                raise
        self._forget()

    def _go_back(self, belief: Belief) -> None:
        """Replace the belief after an odometry message, and forget those after it."""
        key: Key = (belief.now_ns, "", 0)
        while self._known and self._known[-1].key >= key:
            key_of_last, _ = self._known.pop()
            if key_of_last[:2] == key[:2]:
                key = key_of_last
        self._known.append(_Known(key, belief))

    def _limit_waiting(self, first: int) -> None:
        """Drop the oldest events that wait for an odometry that does not come."""
        while len(self._entries) - first > _MOST_WAITING:
            gone = self._entries.pop(first)
            self.dropped[f"{_name(gone.event)}: no odometry"] += 1

    def _forget(self) -> None:
        """Forget what is older than the window."""
        newest_ns = self.newest.stamp_ns
        if newest_ns is None:
            return
        horizon_ns = newest_ns - round(self.filter.settings.delay_s * 1e9)
        gone = 0
        while gone + 1 < len(self._known) and self._known[gone + 1].key[0] <= horizon_ns:
            gone += 1
        if not gone:
            return
        del self._known[:gone]
        first = self._known[0]
        del self._entries[: bisect_right(self._entries, first.key, key=lambda one: one.key)]
        self.filter.odometer.forget(first.key[0])
        self.filter.imu.forget(first.key[0])


def _kind(event: Event) -> str:
    """Order of events of one time: the odometry first, which propagates to that time."""
    return "" if isinstance(event, OdometryEvent) else _name(event)


def _name(event: Event) -> str:
    if isinstance(event, OdometryEvent):
        return "odometry"
    if isinstance(event, StatedPose):
        return "initial pose"
    return f"images of camera {event.camera + 1}" if isinstance(event, CameraView) else event.sensor
