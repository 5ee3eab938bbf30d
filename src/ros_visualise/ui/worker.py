"""The thread that carries out the requests of browsers."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError

_MOST_ASKED = 200
"""Maximum number of waiting jobs; further requests are dropped."""


class PageWorker:
    """Does posted jobs, one at a time, and regular work in between.

    Of the jobs posted under one key only the newest is done: a slider that is dragged quickly
    leaves no queue behind.

    Args:
        say: called with the reason of a rejection, one line.
        tick: the regular work, every ``period_s``.
    """

    def __init__(
        self, say: Callable[[str], None], tick: Callable[[], None], period_s: float
    ) -> None:
        self._say, self._tick, self._period_s = say, tick, period_s
        self._posted: dict[Hashable, Callable[[], object]] = {}
        self._closed = False
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start, with the jobs posted before; safe to call twice."""
        if self._thread is None:
            self._thread = supervision.start("page", self._run)

    def post(self, key: Hashable, action: Callable[[], object]) -> None:
        """Post a job, in place of one waiting under the same key."""
        with self._changed:
            self._posted[key] = action
            self._changed.notify_all()

    def is_posted(self, key: Hashable) -> bool:
        """True if a job waits under this key."""
        return key in self._posted

    def close(self, timeout_s: float) -> None:
        """End after the present job."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join(timeout_s)

    def ask(self, key: Hashable, action: Callable[[], object]) -> bool:
        """Post a job for a browser; False if too many wait."""
        has_room = self.is_posted(key) or len(self._posted) < _MOST_ASKED
        if has_room:
            self.post(key, action)
        return has_room

    def _run(self) -> None:
        next_tick_s = time.monotonic()
        while not self._closed:
            if time.monotonic() >= next_tick_s:
                next_tick_s = time.monotonic() + self._period_s
                self._do(self._tick)
            action = self._next(next_tick_s)
            if action is not None:
                self._do(action)

    def _next(self, until_s: float) -> Callable[[], object] | None:
        with self._changed:
            timeout_s = max(0.0, until_s - time.monotonic())
            self._changed.wait_for(lambda: self._posted or self._closed, timeout_s)
            if self._closed or not self._posted:
                return None
            return self._posted.pop(next(iter(self._posted)))

    def _do(self, action: Callable[[], object]) -> None:
        try:
            action()
        except RosVisualiseError as error:
            self._say(str(error))
        except supervision.ERRORS as error:
            supervision.note("page", error)
