"""Stamps that do not belong to the present: one wild stamp is refused, a new time is taken over."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

_AHEAD_NS = 5_000_000_000  # after the newest stamp of all
_BACK_NS = 1_000_000_000  # before the newest of the same sensor
_APART_NS = 2_000_000_000  # longest interval between messages that confirm each other
_MANY = 10  # messages that confirm a new time


class Verdict(Enum):
    """Judgement of a stamp."""

    PRESENT = "present"
    WILD = "wild"
    RESET = "reset"


class _Run(NamedTuple):
    """Refused stamps in a row that follow one another."""

    stamp_ns: int
    length: int


class StampGuard:
    """Judges the stamps of all sensors.

    A stamp far ahead, or an odometry far back, is refused. Ten in a row that follow one another are
    the new present; odometry back in time is a reset.
    """

    def __init__(self) -> None:
        self._newest_ns: int | None = None
        self._last_ns: dict[str, int] = {}
        self._runs: dict[str, _Run] = {}

    def judge(self, sensor: str, stamp_ns: int) -> Verdict:
        """Judge a sensor's stamp."""
        is_time = sensor == "odometry"  # all others may come late
        is_ahead = self._newest_ns is not None and stamp_ns > self._newest_ns + _AHEAD_NS
        is_back = is_time and stamp_ns < self._last_ns.get(sensor, stamp_ns) - _BACK_NS
        if is_ahead or is_back:
            run = self._runs.get(sensor)
            follows = run is not None and 0 < stamp_ns - run.stamp_ns < _APART_NS
            length = run.length + 1 if run and follows else 1
            self._runs[sensor] = _Run(stamp_ns, length)
            if length < _MANY:
                return Verdict.WILD
            if is_back:
                return Verdict.RESET
        self._runs.pop(sensor, None)
        self._last_ns[sensor] = max(stamp_ns, self._last_ns.get(sensor, stamp_ns))
        self._newest_ns = max(stamp_ns, self._newest_ns or stamp_ns)
        return Verdict.PRESENT
