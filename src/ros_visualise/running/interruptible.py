"""Work that Ctrl-C need not wait for."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, wait
from contextlib import contextmanager
from functools import partial
from typing import TypeVar

from ros_visualise.core import supervision
from ros_visualise.core.errors import OpenError
from ros_visualise.core.printing import print_status
from ros_visualise.core.signals import STOPPED, StopRequest

T = TypeVar("T")

_SPIN_S = 0.05
_PATIENCE_S = 3.0
_GRACE_S = 1.0


def begin(make: Callable[[], T]) -> Future[T]:
    """Call ``make`` on a thread of its own."""
    work: Future[T] = Future()

    def run() -> None:
        try:
            work.set_result(make())
        except BaseException as error:
            work.set_exception(error)

    supervision.start("work", run)
    return work


def is_done(work: Future[T], timeout_s: float = _SPIN_S) -> bool:
    """True if it is done, after this time at most."""
    return bool(wait([work], timeout_s).done)


def interruptible(make: Callable[[], T]) -> T:
    """The result of ``make``, called on a thread, so that Ctrl-C need not wait for it."""
    work = begin(make)
    while not is_done(work):
        pass
    return work.result()


def in_a_second(request: StopRequest, make: Callable[[], T]) -> T | None:
    """The result of ``make``; None if it takes a second more after a stop request."""
    work = begin(make)
    since_s = None
    while not is_done(work):
        now_s = time.monotonic()
        since_s = now_s if since_s is None and request.asked else since_s
        if since_s is not None and now_s - since_s > _GRACE_S:
            return None
    return work.result()


def opened_within(
    name: str,
    limit_s: float,
    request: StopRequest,
    make: Callable[[], T],
    close: Callable[[T], object],
) -> T | None:
    """The result of ``make``; None after a stop request.

    Args:
        name: of what is opened.
        limit_s: how long it may take.
        request: a stop request.
        make: opens it, on a thread that is left alone when it is not awaited any longer.
        close: called with a result that comes too late.

    Raises:
        OpenError: it takes longer.
    """
    work = begin(make)
    end_s = time.monotonic() + limit_s
    while not is_done(work):
        is_late = time.monotonic() > end_s
        if request.asked or is_late:
            work.add_done_callback(partial(_close_result, close))
        if request.asked:
            return None
        if is_late:
            raise OpenError(
                f"{name}: not opened within {limit_s:g} s; open it from the command line"
            )
    return work.result()


def _close_result(close: Callable[[T], object], work: Future[T]) -> None:
    if work.exception() is None:
        close(work.result())


@contextmanager
def in_time(request: StopRequest, steps: Callable[[], int | None]) -> Iterator[None]:
    """Within this, one message cannot delay the end after a stop request.

    When no step is done for three seconds the process is ended as if it were killed.

    Args:
        request: a stop request.
        steps: number of messages processed; None while files are closed, which may take time.
    """
    over = threading.Event()
    supervision.start("end", partial(_leave_if_stuck, request, steps, over), again_s=_SPIN_S)
    try:
        yield
    finally:
        over.set()


def _leave_if_stuck(
    request: StopRequest, steps: Callable[[], int | None], over: threading.Event
) -> None:
    done, since_s = None, time.monotonic()
    while not over.wait(_SPIN_S):
        now, now_s = steps(), time.monotonic()
        if now is None or now != done or not request.asked:
            done, since_s = now, now_s
        elif now_s - since_s > _PATIENCE_S:
            print_status(
                f"ros-visualise: forced exit: a message did not finish within {_PATIENCE_S:g} s"
            )
            os._exit(STOPPED)
