"""Ending the process while a network runs, for which Python does not wait.

A thread that returns from onnxruntime after Python has ended aborts the process as if it had
crashed.
"""

from __future__ import annotations

import atexit
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_SPIN_S, _PATIENCE_S = 0.01, 0.5
_at_work: set[Callable[[], None]] = set()
_is_over = threading.Event()


@contextmanager
def stoppable(stop: Callable[[], None]) -> Iterator[None]:
    """Context in which a thread runs onnxruntime, and ``stop`` interrupts it at the process's end.

    An interrupted thread waits for that end, as its result is no longer needed.
    """
    _at_work.add(stop)
    try:
        yield
    finally:
        _at_work.discard(stop)
        if _is_over.is_set():
            threading.Event().wait()


def is_anybody_at_work() -> bool:
    """True if a thread is in onnxruntime."""
    return bool(_at_work)


@atexit.register
def _call_back() -> None:
    _is_over.set()
    until_s = time.monotonic() + _PATIENCE_S
    while _at_work and time.monotonic() < until_s:
        for stop in tuple(_at_work):
            stop()
        time.sleep(_SPIN_S)
