"""What ends a process from outside: Ctrl-C, SIGTERM, and SIGHUP, which a closed terminal sends.

All three mean the same, with one exit status: `STOPPED` of a command, which has left its work
undone; 0 of a ROS executable, whose work ends so. Only the first one counts: a process that is
ending already is not disturbed. One that was started with ``nohup`` goes on when its terminal is
closed.
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
"""Exit status of a process that was asked to end before it had done its work."""

DONE = 0
"""Exit status of a process that runs until it is asked to end, and was."""

_ENDING = ("SIGINT", "SIGTERM", "SIGHUP")


def leave_at_once(status: int = STOPPED) -> None:
    """End the process where it stands, from now on: while there is nothing yet to clean up.

    A KeyboardInterrupt would become a traceback, or another error, inside an import. Ctrl-C is
    heard also where it was ignored, as in a shell's background jobs.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    _handle(lambda *_: os._exit(status))


def leave(ended: Sequence[int]) -> None:
    """End the process here, at the very end, when all is closed.

    Python would go on and take itself apart, which lasts most of a second; and under threads that
    nobody waits for: one that comes back from a library then ends the process as if it had crashed.

    Args:
        ended: the exit status, once there is one.
    """
    if not ended:
        return
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):
            stream.flush()
    os._exit(ended[-1])


class Wish:
    """Whether somebody ``asked`` for the end."""

    asked = False


def interrupt(status: int = STOPPED) -> Wish:
    """Raise a KeyboardInterrupt in the main thread, from now on; once.

    Args:
        status: exit status of the process that is left at once inside an import, where the
            KeyboardInterrupt would become another error.

    Returns:
        Whether that has happened, for a caller of code that may swallow it.
    """
    wish = Wish()

    def raise_once(_: int, frame: FrameType | None) -> None:
        if _is_importing(frame):
            os._exit(status)
        wish.asked = True
        ignore()
        _leave_terminal()
        raise KeyboardInterrupt

    _handle(raise_once)
    return wish


def _is_importing(frame: FrameType | None) -> bool:
    while frame is not None and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    return frame is not None


def note(wish: Wish) -> dict[Any, Any]:
    """Note that somebody asks for the end, and interrupt nothing, from now on.

    For work that has something to close; it has to look at the wish now and then.

    Returns:
        The handlers that there were before.
    """

    def hear(*_: object) -> None:
        _leave_terminal()
        wish.asked = True

    return _handle(hear)


@contextmanager
def noticed() -> Iterator[Wish]:
    """Within this, it is noted that somebody asks for the end; see `note`."""
    wish = Wish()
    before = note(wish)
    try:
        yield wish
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if wish.asked else handler)


def ignore() -> None:
    """Go on to the end, whatever is asked."""
    _handle(signal.SIG_IGN)


def _handle(handler: Callable[[int, FrameType | None], Any] | signal.Handlers) -> dict[Any, Any]:
    """Have a handler called; what was there before. What is ignored stays ignored."""
    known = [signal.Signals[name] for name in _ENDING if hasattr(signal, name)]  # not on Windows
    heard = [number for number in known if signal.getsignal(number) is not signal.SIG_IGN]
    return {number: signal.signal(number, handler) for number in heard}


def _leave_terminal() -> None:
    """Where output went to a terminal that is gone it goes nowhere, and raises no errors."""
    for descriptor in (1, 2):
        with suppress(OSError):
            if not _is_gone(descriptor):
                continue
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, descriptor)
            os.close(nowhere)


def _is_gone(descriptor: int) -> bool:
    try:
        os.write(descriptor, b"")
    except OSError:
        return True
    return False
