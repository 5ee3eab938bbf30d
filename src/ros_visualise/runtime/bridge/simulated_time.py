"""The time that somebody publishes on a graph, as on ``/clock``."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

log = logging.getLogger(__name__)

_STEP_S = 0.005
_LATE_NS = 1_000_000_000
"""Publishers of one time may disagree by less."""


class SimulatedClock:
    """Time that stands still, runs at any speed and jumps; see `ros_visualise.core.rate.Clock`.

    Playing keeps to it. Where it jumps back, as when a recording starts over, playing goes on from
    there: stamps jump with it.

    Args:
        read: gives the time, nanoseconds; 0 until there is one.
    """

    def __init__(self, read: Callable[[], int]) -> None:
        self._read = read
        self._last_ns = self._passed_ns = 0
        self._has_jumped = False
        self._lock = threading.Lock()

    def now_ns(self) -> int:
        """The time as it is published; 0 until it has come."""
        return self._read()

    def monotonic_ns(self) -> int:
        """The time that has passed, without the jumps back."""
        with self._lock:
            now_ns = self._read()
            step_ns, self._last_ns = now_ns - self._last_ns, now_ns
            self._passed_ns += max(step_ns, 0)
            is_new = step_ns < -_LATE_NS and not self._has_jumped
            self._has_jumped |= is_new
        if is_new:
            log.warning(
                "simulated time jumped back by %.1f s; going on from there"
                " (further warnings suppressed)",
                -step_ns / 1e9,
            )
        return self._passed_ns

    def wait(self, condition: threading.Condition, until_ns: int | None) -> None:
        """Wait for a notification, or look at the clock again."""
        condition.wait(None if until_ns is None else _STEP_S)
