"""Work that Ctrl-C need not wait for."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Generic, TypeVar

from ros_visualise.core import supervision
from ros_visualise.core.errors import OpenError
from ros_visualise.core.printing import say
from ros_visualise.core.signals import STOPPED, Wish

T = TypeVar("T")

_SPIN_S = 0.05
_PATIENCE_S = 3.0
_GRACE_S = 1.0


def interruptible(make: Callable[[], T]) -> T:
    """What ``make`` returns, made on a thread, so that Ctrl-C need not wait for it."""
    work = _Work(make)
    while not work.is_done(_SPIN_S):
        pass
    return work.result


def in_a_second(wish: Wish, make: Callable[[], T]) -> T | None:
    """What ``make`` returns; None where it takes a second more when somebody asks for the end."""
    work = _Work(make)
    since_s = None
    while not work.is_done(_SPIN_S):
        now_s = time.monotonic()
        since_s = now_s if since_s is None and wish.asked else since_s
        if since_s is not None and now_s - since_s > _GRACE_S:
            return None
    return work.result


def opened_within(
    path: Path,
    limit_s: float,
    wish: Wish,
    make: Callable[[], T],
    close: Callable[[T], object],
) -> T | None:
    """What ``make`` opens; None where somebody asks for the end meanwhile.

    Args:
        path: what is opened.
        limit_s: how long it may take.
        wish: for the end.
        make: opens it, on a thread that is left alone when it is not awaited any longer.
        close: called with what comes too late.

    Raises:
        OpenError: it takes longer.
    """
    work = _Work(make)
    end_s = time.monotonic() + limit_s
    while not work.is_done(_SPIN_S):
        if wish.asked:
            work.leave(close)
            return None
        if time.monotonic() > end_s:
            work.leave(close)
            raise OpenError(f"{path}: not open after {limit_s:g} s; open it on the command line")
    return work.result


class _Work(Generic[T]):
    """Something that is made on a thread."""

    def __init__(self, make: Callable[[], T]) -> None:
        self._make = make
        self._close: Callable[[T], object] | None = None
        self._handing = threading.Lock()
        self._results: list[T] = []
        self._errors: list[BaseException] = []
        self._thread = supervision.start("work", self._work)

    def is_done(self, timeout_s: float) -> bool:
        """Whether it is, after so long at most."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    @property
    def result(self) -> T:
        """What was made, once it is; raises what that raised."""
        if self._errors:
            raise self._errors[0]
        return self._results[0]

    def leave(self, close: Callable[[T], object]) -> None:
        """Await it no longer: what was or will be made is closed."""
        with self._handing:
            self._close = close
        for result in self._results:
            close(result)

    def _work(self) -> None:
        try:
            result = self._make()
        except BaseException as error:
            self._errors.append(error)
            return
        with self._handing:
            close = self._close
            if close is None:
                self._results.append(result)
        if close is not None:
            close(result)


@contextmanager
def in_time(wish: Wish, steps: Callable[[], int | None]) -> Iterator[None]:
    """Within this, a wish for the end is not held up by one message.

    When no step is done for three seconds the process is left as it stands, as if it were killed.

    Args:
        wish: for the end.
        steps: how many messages were worked on; None while files are closed, which may take time.
    """
    over = threading.Event()
    supervision.start("end", partial(_leave_if_stuck, wish, steps, over), again_s=_SPIN_S)
    try:
        yield
    finally:
        over.set()


def _leave_if_stuck(wish: Wish, steps: Callable[[], int | None], over: threading.Event) -> None:
    done, since_s = None, time.monotonic()
    while not over.wait(_SPIN_S):
        now, now_s = steps(), time.monotonic()
        if now is None or now != done or not wish.asked:
            done, since_s = now, now_s
        elif now_s - since_s > _PATIENCE_S:
            say("ros-visualise: ended in the middle of a message that takes long, as if killed")
            os._exit(STOPPED)
