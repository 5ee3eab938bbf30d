"""One parent for all that runs beside the main thread: whatever fails says so, is counted, and
takes nobody else with it.

A thread that lives long is started by `start`; a call into code that must not end its caller, such
as a consumer of a topic, is made by `attempt`. What such code raises is logged with its place, once
for each place, and counted; a process in which anything failed ends with exit status 1 where it
would have been 0.
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
"""What is caught of code that runs beside the main thread: there ``exit()`` ends a thread alone."""


class Failure(NamedTuple):
    """One thing that went wrong, as often as it did: who, with what kind of error, and where."""

    who: str
    kind: str
    place: str


class Supervisor:
    """Hears how threads and calls end."""

    def __init__(self) -> None:
        self._counts: Counter[Failure] = Counter()
        self._counting = threading.Lock()

    def start(
        self, name: str, work: Callable[[], object], again_s: float | None = None
    ) -> threading.Thread:
        """Run ``work`` on a daemon thread of this name.

        Args:
            name: says who failed, if it does.
            work: returns when it is to end.
            again_s: where the work is to look at something now and then, it begins anew this many
                seconds after it failed; None ends the thread.
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
        """Count an error that ended something; log the first one of each place."""
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
        """What failed, and how often."""
        with self._counting:
            return dict(self._counts)

    def forget(self) -> None:
        """Begin to count anew."""
        with self._counting:
            self._counts.clear()


def _place(error: BaseException) -> str:
    """File and line where an error was raised, as ``topics.py:120``."""
    frames = traceback.extract_tb(error.__traceback__)
    return f"{frames[-1].filename.rpartition('/')[2]}:{frames[-1].lineno}" if frames else "?"


PROCESS = Supervisor()
"""That of this process; its failures set the process's exit status."""

start, attempt, note = PROCESS.start, PROCESS.attempt, PROCESS.note


def status_of(status: int) -> int:
    """Exit status of this process: 1 where its work is done (0), but something beside it failed."""
    return 1 if status == 0 and PROCESS.failures else status
