"""Warnings of the log and rejections, for all browsers."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from ros_visualise.ui.live.board import LiveBoard

_MOST = 50
_NAME = "notices"


class Notice(NamedTuple):
    """A line: its number, the time of the clock, its level, its text, and how often it came."""

    number: int
    time_s: float
    level: str
    text: str
    times: int


class Notices(logging.Handler):
    """The newest lines; safe to call from any thread."""

    def __init__(self, clock: Callable[[], float] = time.time) -> None:
        super().__init__(logging.WARNING)
        self._clock = clock
        self._lines: deque[Notice] = deque(maxlen=_MOST)
        self._count = 0
        self._are_new = True  # none, for browsers that open before the first one
        self._noting = threading.Lock()

    def note(self, text: str, level: str = "warning") -> None:
        """Note a line; the same one as before is counted."""
        with self._noting:
            self._count += 1
            self._are_new = True
            times = 1
            if self._lines and self._lines[-1].text == text:
                times += self._lines.pop().times
            self._lines.append(Notice(self._count, self._clock(), level, text, times))

    def emit(self, record: logging.LogRecord) -> None:
        """Note a logged warning or error."""
        self.note(record.getMessage(), record.levelname.lower())

    def show(self, board: LiveBoard) -> None:
        """Send the lines if there are new ones."""
        with self._noting:
            if not self._are_new:
                return
            self._are_new, lines = False, list(self._lines)
        board.put(_NAME, {"notices": lines})
