"""Work that Ctrl-C need not wait for."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from ros_visualise.printing import say
from ros_visualise.signals import STOPPED, Wish

T = TypeVar("T")

_SPIN_S = 0.05
_PATIENCE_S = 3.0


def interruptible(make: Callable[[], T]) -> T:
    """What ``make`` returns, made on a thread, so that Ctrl-C need not wait for it."""
    results: list[T] = []
    errors: list[BaseException] = []

    def work() -> None:
        try:
            results.append(make())
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(_SPIN_S)
    if errors:
        raise errors[0]
    return results[0]


@contextmanager
def in_time(wish: Wish, steps: Callable[[], int | None]) -> Iterator[None]:
    """Within this, a wish for the end is not held up by one message.

    When no step is done for three seconds the process is left as it stands, as if it were killed.

    Args:
        wish: for the end.
        steps: how many messages were worked on; None while files are closed, which may take time.
    """
    over = threading.Event()
    threading.Thread(target=_leave_if_stuck, args=(wish, steps, over), daemon=True).start()
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
