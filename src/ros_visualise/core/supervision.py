"""Supervision of all that runs beside the main thread: failures are logged, counted and contained.

A long-lived thread is started by `start`; a call into code that must not end its caller, such as a
listener of a topic, is made by `attempt`. Errors are logged once for each place in the code, and
counted; a process with any failure ends with exit status 1 instead of 0.
"""

from __future__ import annotations

import logging
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

from ros_visualise.core.errors import RosVisualiseError

log = logging.getLogger(__name__)

ERRORS = (Exception, SystemExit)
"""Errors caught beside the main thread, where ``exit()`` would end a thread silently."""


class Failure(NamedTuple):
    """A failure: name of the thread or call, type of the error, and place in the code."""

    who: str
    kind: str
    place: str


class Supervisor:
    """Counts how threads and calls fail."""

    def __init__(self) -> None:
        self._counts: Counter[Failure] = Counter()
        self._counting = threading.Lock()

    def start(
        self, name: str, work: Callable[[], object], again_s: float | None = None
    ) -> threading.Thread:
        """Run ``work`` on a daemon thread of this name.

        Args:
            name: of the thread, for the log.
            work: returns to end the thread.
            again_s: seconds after which failed work is started again; None: never.
        """

        def run() -> None:
            while not self.attempt(name, work, BaseException) and again_s is not None:
                time.sleep(again_s)

        thread = threading.Thread(target=run, name=name, daemon=True)
        thread.start()
        return thread

    def attempt(
        self,
        name: str,
        work: Callable[[], object],
        caught: type[BaseException] | tuple[type[BaseException], ...] = ERRORS,
    ) -> bool:
        """Call ``work``; False, with the error logged and counted, if it raised one."""
        try:
            work()
        except caught as error:
            self.note(name, error)
            return False
        return True

    def note(self, name: str, error: BaseException) -> None:
        """Count an error, and log the first one of each place."""
        failure = Failure(name, type(error).__name__, _place(error))
        with self._counting:
            self._counts[failure] += 1
            is_first = self._counts[failure] == 1
        if is_first:
            is_ours = isinstance(error, RosVisualiseError)
            text = str(error) if is_ours else f"{failure.kind}: {error} ({failure.place})"
            bug = None if is_ours else (type(error), error, error.__traceback__)
            log.error("%s failed: %s (further occurrences suppressed)", name, text, exc_info=bug)

    @property
    def failures(self) -> dict[Failure, int]:
        """Failures and their counts."""
        with self._counting:
            return dict(self._counts)

    def forget(self) -> None:
        """Reset the counts."""
        with self._counting:
            self._counts.clear()


def _place(error: BaseException) -> str:
    """File and line where an error was raised, as ``topics.py:120``."""
    frames = traceback.extract_tb(error.__traceback__)
    return f"{frames[-1].filename.rpartition('/')[2]}:{frames[-1].lineno}" if frames else "?"


PROCESS = Supervisor()
"""The supervisor of this process; its failures set the exit status."""

start, attempt, note = PROCESS.start, PROCESS.attempt, PROCESS.note


def status_of(status: int) -> int:
    """Exit status of this process: 1 instead of 0 if anything failed."""
    return 1 if status == 0 and PROCESS.failures else status
