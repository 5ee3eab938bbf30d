"""The search over all that the page offers."""

from __future__ import annotations

from collections.abc import Mapping

from nicegui.element import Element


class Search(Element, component="search.js"):
    """A dialog, opened by Ctrl-K."""

    def __init__(self, kinds: Mapping[str, object], read_only: bool) -> None:
        super().__init__()
        self._props["kinds"], self._props["read-only"] = dict(kinds), read_only
