"""The end of a process while a network works: Python does not wait, and onnxruntime does not know.

A thread that is in onnxruntime when Python ends, and comes back, aborts the process as if it had
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
    """Within this, a thread is in onnxruntime, and ``stop`` calls it back at the process's end.

    A thread that was called back waits for that end: what it works on concerns nobody any more.
    """
    _at_work.add(stop)
    try:
        yield
    finally:
        _at_work.discard(stop)
        if _is_over.is_set():
            threading.Event().wait()


def is_anybody_at_work() -> bool:
    """Whether a thread is in onnxruntime."""
    return bool(_at_work)


@atexit.register
def _call_back() -> None:
    _is_over.set()
    until_s = time.monotonic() + _PATIENCE_S
    while _at_work and time.monotonic() < until_s:
        for stop in tuple(_at_work):
            stop()
        time.sleep(_SPIN_S)
