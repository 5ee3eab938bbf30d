"""Signals that end a process: Ctrl-C, SIGTERM, and SIGHUP, which a closed terminal sends.

All three mean the same, with one exit status: `STOPPED` for a command, which has not finished its
work; 0 for a ROS executable. Only the first one counts. A process that was started with ``nohup``
goes on when its terminal is closed.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

STOPPED = 130
"""Exit status of a process that was stopped before it had done its work."""

DONE = 0
"""Exit status of a process that runs until it is stopped."""

_ENDING = ("SIGINT", "SIGTERM", "SIGHUP")


def exit_at_once(status: int = STOPPED) -> None:
    """Let signals end the process at once, from now on: while there is nothing to clean up.

    A KeyboardInterrupt would become a traceback, or another error, inside an import. Ctrl-C works
    even if it was ignored, as in a shell's background jobs.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    _handle(lambda *_: os._exit(status))


def leave(ended: Sequence[int]) -> None:
    """End the process here, at the very end, when all is closed.

    Python's own shutdown takes most of a second, and daemon threads that return from a library
    during it would crash the process.

    Args:
        ended: the exit status, if there is one yet.
    """
    if not ended:
        return
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):
            stream.flush()
    os._exit(ended[-1])


class StopRequest:
    """A request to stop this process; ``asked`` is True once it was made."""

    asked = False


def interrupt(status: int = STOPPED) -> StopRequest:
    """Raise a KeyboardInterrupt in the main thread, from now on; once.

    Args:
        status: exit status of the process that is left at once inside an import, where the
            KeyboardInterrupt would become another error.

    Returns:
        The request, for callers of code that may swallow a KeyboardInterrupt.
    """
    request = StopRequest()

    def raise_once(_: int, frame: FrameType | None) -> None:
        if _is_importing(frame):
            os._exit(status)
        request.asked = True
        ignore()
        _leave_terminal()
        raise KeyboardInterrupt

    _handle(raise_once)
    return request


def _is_importing(frame: FrameType | None) -> bool:
    while frame is not None and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    return frame is not None


def note(request: StopRequest) -> dict[Any, Any]:
    """Note stop requests, and interrupt nothing, from now on.

    For work that has something to close; it has to look at the request now and then.

    Returns:
        The previous handlers.
    """

    def take(*_: object) -> None:
        _leave_terminal()
        request.asked = True

    return _handle(take)


@contextmanager
def noticed() -> Iterator[StopRequest]:
    """Note stop requests within this block; see `note`."""
    request = StopRequest()
    before = note(request)
    try:
        yield request
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if request.asked else handler)


def ignore() -> None:
    """Ignore signals from now on."""
    _handle(signal.SIG_IGN)


def _handle(handler: Callable[[int, FrameType | None], Any] | signal.Handlers) -> dict[Any, Any]:
    """Install a handler, and return the previous ones; ignored signals stay ignored."""
    known = [signal.Signals[name] for name in _ENDING if hasattr(signal, name)]  # not on Windows
    taken = [number for number in known if signal.getsignal(number) is not signal.SIG_IGN]
    return {number: signal.signal(number, handler) for number in taken}


def _leave_terminal() -> None:
    """Discard output to a closed terminal, instead of raising errors."""
    for descriptor in (1, 2):
        with suppress(OSError):
            if not _is_closed(descriptor):
                continue
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, descriptor)
            os.close(nowhere)


def _is_closed(descriptor: int) -> bool:
    try:
        os.write(descriptor, b"")
    except OSError:
        return True
    return False
