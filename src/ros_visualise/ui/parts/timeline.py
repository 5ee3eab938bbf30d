"""The timeline: the clock, the controls of playback and a bar to scrub, in a browser."""

from __future__ import annotations

from nicegui.element import Element


class Timeline(Element, component="timeline.js"):
    """The full width of the page; ``read_only`` shows the time alone."""

    def __init__(self, read_only: bool) -> None:
        super().__init__()
        self._props["read-only"] = read_only
