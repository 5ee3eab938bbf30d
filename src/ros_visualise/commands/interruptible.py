"""Work that Ctrl-C need not wait for."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

_SPIN_S = 0.05


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
