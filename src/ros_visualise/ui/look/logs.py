"""What was logged last, for a browser that asks."""

from __future__ import annotations

import logging
import threading
from collections import deque
from typing import Any

_KEPT = 1000
_LONGEST = 2000


class Lines(logging.Handler):
    """The last lines of the log, numbered; the handler may be called from any thread."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self._lines: deque[dict[str, Any]] = deque(maxlen=_KEPT)
        self._number = 0
        self._guard = threading.Lock()

    def emit(self, record: logging.LogRecord) -> None:
        self.add(record.created, record.levelname, record.threadName or "", record.getMessage())

    def add(self, time_s: float, level: str, node: str, text: str) -> None:
        """Add a line; the time is seconds since 1970."""
        line = {"time": time_s, "level": level, "node": node, "text": text[:_LONGEST]}
        with self._guard:
            self._number += 1
            self._lines.append({"number": self._number, **line})

    def after(self, number: int) -> list[dict[str, Any]]:
        """Those with larger numbers."""
        with self._guard:
            return [line for line in self._lines if line["number"] > number]
