"""The newest text of a topic, in the window of the node that tells it."""

from __future__ import annotations

import viser

from ros_visualise.data import Text
from ros_visualise.lessons.prose import to_html
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.feed import Feed


class Note:
    """A text, in the present container; it is shown as it is written, never as markup."""

    def __init__(self, gui: viser.GuiApi, runtime: Runtime, topic: str) -> None:
        self._topic = topic
        self._feed = Feed(runtime)
        self._shown = ""
        self._element = gui.add_html("")

    def refresh(self) -> None:
        """Show what is new."""
        self._feed.follow(self._topic)
        message = self._feed.take()
        if isinstance(message, Text) and message.text != self._shown:
            self._shown = message.text
            self._element.content = f'<div class="rv-text">{to_html(message.text)}</div>'

    def rest(self) -> None:
        """Ask for nothing until the next `refresh`."""
        self._feed.follow(None)
