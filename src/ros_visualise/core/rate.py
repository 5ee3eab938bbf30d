"""Clocks and pacing. Clocks are objects, so that tests bring their own."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Protocol

log = logging.getLogger(__name__)

MAX_RATE = 100
"""Highest playback rate; 0 is unthrottled."""

_STEP_NS = 200_000_000  # less is jitter of messages, or a slewed clock
_JUMP_NS = 1_000_000_000  # publishers of one time may disagree by less
_LOOK_S = 0.005


class Clock(Protocol):
    """A source of time, which also waits for it."""

    def now_ns(self) -> int:
        """The time of stamps, nanoseconds since 1970; 0 while it is unknown."""

    def monotonic_ns(self) -> int:
        """Nanoseconds that only ever grow, for measuring and waiting."""

    def wait(self, condition: threading.Condition, until_ns: int | None) -> None:
        """Wait, holding ``condition``, until it is notified or its monotonic time has come.

        It may return early; None waits forever.
        """


class WallClock:
    """The time of day."""

    def now_ns(self) -> int:
        """Nanoseconds since 1970."""
        return time.time_ns()

    def monotonic_ns(self) -> int:
        """Monotonic time, nanoseconds."""
        return time.monotonic_ns()

    def wait(self, condition: threading.Condition, until_ns: int | None) -> None:
        """Wait for a notification or until a monotonic time."""
        timeout_s = None if until_ns is None else (until_ns - time.monotonic_ns()) / 1e9
        if timeout_s is None or timeout_s > 0:
            condition.wait(timeout_s)


class SimulatedClock:
    """Time that is published on a graph, as on ``/clock``: it may stand still, and jump.

    Where it jumps back, as when a recording starts over, playing goes on from there: stamps jump
    with it.

    Args:
        read: gives the time, nanoseconds; 0 if unknown.
    """

    def __init__(self, read: Callable[[], int]) -> None:
        self._read = read
        self._last_ns = self._passed_ns = 0
        self._has_jumped = False
        self._lock = threading.Lock()

    def now_ns(self) -> int:
        """The published time, nanoseconds; 0 if unknown."""
        return self._read()

    def monotonic_ns(self) -> int:
        """Nanoseconds that have passed, without the jumps back."""
        with self._lock:
            now_ns = self._read()
            step_ns, self._last_ns = now_ns - self._last_ns, now_ns
            self._passed_ns += max(step_ns, 0)
            is_new = step_ns < -_JUMP_NS and not self._has_jumped
            self._has_jumped |= is_new
        if is_new:
            log.warning(
                "simulated time jumped back by %.1f s; continuing from there"
                " (further warnings suppressed)",
                -step_ns / 1e9,
            )
        return self._passed_ns

    def wait(self, condition: threading.Condition, until_ns: int | None) -> None:
        """Wait for a notification, but no longer than until the clock may have advanced."""
        condition.wait(None if until_ns is None else _LOOK_S)


class Steady:
    """Removes the steps from times of a wall clock that is being set.

    Attributes:
        step_ns: step of the clock before the last time, ahead or back; 0 if none.
    """

    def __init__(self) -> None:
        self.step_ns = 0
        self._last: tuple[int, int] | None = None
        self._steps_ns = self._newest_ns = 0

    def of(self, time_ns: int, monotonic_ns: int) -> int:
        """The time without the steps, never before the last; both times were read together."""
        last_ns, last_monotonic_ns = self._last or (time_ns, monotonic_ns)
        apart_ns = (time_ns - last_ns) - (monotonic_ns - last_monotonic_ns)
        self.step_ns = apart_ns if abs(apart_ns) > _STEP_NS else 0
        self._steps_ns += self.step_ns
        self._last = time_ns, monotonic_ns
        self._newest_ns = max(self._newest_ns, time_ns - self._steps_ns)
        return self._newest_ns


class Pacer:
    """Chooses which messages of a stream pass, so that they pass at a requested rate.

    A phase accumulator over the messages' own stamps: due times lie one period apart, and for each
    the nearest message passes. So the mean rate is the requested one and no gap is off by more
    than one period of the input, whatever the ratio of the two rates; nothing is ever repeated. A
    message that comes late takes no time.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the phase: the next message passes."""
        self._stamp_ns: int | None = None
        self._time_ns = self._passed_ns = 0
        self._due_ns = self._period_ns = 0.0

    def passes(self, stamp_ns: int, rate_hz: float) -> bool:
        """True if the message of that stamp passes at ``rate_hz``; ask once for each."""
        last_ns = stamp_ns if self._stamp_ns is None else self._stamp_ns
        self._stamp_ns = stamp_ns
        return self._passes(max(stamp_ns - last_ns, 0), 1e9 / rate_hz)

    def _passes(self, step_ns: int, period_ns: float) -> bool:
        self._time_ns = time_ns = self._time_ns + step_ns
        if period_ns != self._period_ns and time_ns:
            self._due_ns = self._passed_ns + period_ns
        self._period_ns = period_ns
        if time_ns + step_ns / 2 < self._due_ns:
            return False
        self._passed_ns = time_ns
        behind = self._due_ns + period_ns <= time_ns
        self._due_ns = (time_ns if behind else self._due_ns) + period_ns
        return True
