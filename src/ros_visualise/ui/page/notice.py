"""A line on the page, for a while: why something was refused, and warnings."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from html import escape

import viser

_SHOWN_S = 10.0


class Notice:
    """The line; all calls come from one thread."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._element = gui.add_html("", visible=False)
        self._until_s = 0.0

    def say(self, message: str) -> None:
        """Show this, for a while."""
        self._until_s = time.monotonic() + _SHOWN_S
        self._element.content = f'<div class="rv-message">{escape(message)}</div>'
        self._element.visible = True

    def refresh(self) -> None:
        """Remove a line that was shown long enough."""
        if time.monotonic() > self._until_s:
            self._element.visible = False


class Warnings(logging.Handler):
    """Passes on logged warnings and errors, from any thread."""

    def __init__(self, say: Callable[[str], None]) -> None:
        super().__init__(logging.WARNING)
        self._say = say

    def emit(self, record: logging.LogRecord) -> None:
        self._say(record.getMessage())
