"""Periodic work on a thread that leaves the nodes enough processor time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from ros_visualise.core import supervision

_REST, _REST_UNTHROTTLED = 2.0, 8.0
"""Seconds of pause for each second of computing: the nodes come first."""


class PeriodicThread:
    """Does rounds until it is closed, then ``finish``.

    Args:
        period_s: shortest time from one round to the next.
        unthrottled: True while the graph runs as fast as possible, and work here slows it.

    Attributes:
        at_work: the lock that is held during a round.
    """

    def __init__(
        self,
        name: str,
        do_round: Callable[[], None],
        finish: Callable[[], None],
        period_s: float,
        unthrottled: Callable[[], bool],
    ) -> None:
        self.at_work = threading.Lock()
        self._round, self._ending = do_round, finish
        self._period_s, self._unthrottled = period_s, unthrottled
        self._closed = threading.Event()
        self._name = name
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        self._thread = supervision.start(self._name, self._run)

    def close(self, timeout_s: float) -> None:
        """End after the present round."""
        self._closed.set()
        if self._thread is not None:
            self._thread.join(timeout_s)

    def _run(self) -> None:
        pause_s = 0.0
        while not self._closed.wait(pause_s):
            start_s, cpu_s = time.perf_counter(), time.thread_time()
            with self.at_work:
                supervision.attempt(self._name, self._round)
            rest = _REST_UNTHROTTLED if self._unthrottled() else _REST
            spent_s = time.perf_counter() - start_s
            pause_s = max(self._period_s - spent_s, rest * (time.thread_time() - cpu_s))
        self._ending()
