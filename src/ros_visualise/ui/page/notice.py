"""Lines that appear on the page for a while: rejections and warnings."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from html import escape

import viser

_SHOWN_S = 10.0
_MOST = 4


class Notice:
    """The newest lines; safe to call from any thread."""

    def __init__(self, gui: viser.GuiApi, clock: Callable[[], float] = time.monotonic) -> None:
        self._element = gui.add_html("", visible=False)
        self._clock = clock
        self._until_s: dict[str, float] = {}
        self._lock = threading.Lock()

    def say(self, message: str) -> None:
        """Show a line from the next `refresh` on."""
        with self._lock:
            self._until_s.pop(message, None)
            self._until_s[message] = self._clock() + _SHOWN_S
            for oldest in list(self._until_s)[:-_MOST]:
                del self._until_s[oldest]

    def refresh(self) -> None:
        """Show new lines and remove old ones."""
        with self._lock:
            now_s = self._clock()
            self._until_s = {line: end for line, end in self._until_s.items() if end > now_s}
            lines = "".join(f"<div>{escape(line)}</div>" for line in self._until_s)
        content = f'<div class="rv-message">{lines}</div>' if lines else ""
        if content != self._element.content:
            self._element.content, self._element.visible = content, bool(lines)


class Warnings(logging.Handler):
    """Passes on logged warnings and errors, from any thread."""

    def __init__(self, say: Callable[[str], None]) -> None:
        super().__init__(logging.WARNING)
        self._say = say

    def emit(self, record: logging.LogRecord) -> None:
        self._say(record.getMessage())
