"""The workspace: panels side by side, which a person places in the browser."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from nicegui import events
from nicegui.element import Element

from ros_visualise.core.errors import UsageError
from ros_visualise.ui.shell.panels import PANELS, Panel

LAYOUT = "layout"
"""The query of an address with a layout; see `read_layout`."""
_SWAPPED = str.maketrans('"~', '~"')
_MOST_PANELS, _MOST_BYTES, _DEEPEST = 48, 16384, 24


class Workspace(Element, component="workspace.js"):
    """The panels of one browser, made as it asks for them.

    Args:
        kinds: of panels, as `ros_visualise.ui.shell.panels.kinds` gives them.
        layout: of the page's address, or None.
        standard: the layout of addresses without one.
        read_only: panels only show.
    """

    def __init__(
        self, kinds: Mapping[str, object], layout: object, standard: object, read_only: bool
    ) -> None:
        super().__init__()
        self._read_only = read_only
        self._panels: dict[int, Panel] = {}
        self._props["kinds"] = dict(kinds)
        self._props["layout"], self._props["standard"] = layout, standard
        self.on("panels", self._hear)

    def _hear(self, event: events.GenericEventArguments) -> None:
        """Make the panels that the browser asks for, and remove the others."""
        wanted = dict(_wanted(event.args))
        for number in self._panels.keys() - wanted.keys():
            self._panels.pop(number).delete()
        for number, (kind, state) in wanted.items():
            if number in self._panels:
                continue
            with self, suppress(UsageError):  # a kind that is not there
                panel = PANELS.find(kind)(state, self._read_only)
                panel.props(f"data-panel={number} role=tabpanel aria-labelledby=rv-tab-{number}")
                panel.classes("rv-panel")
                self._panels[number] = panel


def read_layout(text: str) -> object:
    """The layout in an address, for the browser, which checks it; None if it cannot be one.

    JSON with ~ in place of ": a panel is ``{panel, state}``, panels in one place ``{tabs, shown}``,
    and ``{row, at}`` and ``{column, at}`` hold others, with the share of each.
    """
    if not 2 < len(text) <= _MOST_BYTES:
        return None
    try:
        found = json.loads(text.translate(_SWAPPED))
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) and _depth(found) <= _DEEPEST else None


def _depth(found: object, depth: int = 0) -> int:
    """Depth of what is within one another, counted until it is too deep."""
    if isinstance(found, dict):
        found = [*found.values()]
    if not isinstance(found, list) or depth > _DEEPEST:
        return depth
    return max((_depth(one, depth + 1) for one in found), default=depth)


def _wanted(asked: Any) -> Iterator[tuple[int, tuple[str, Mapping[str, Any]]]]:
    """Number, kind and state of the panels that a browser asks for, as far as they are valid."""
    for one in asked[:_MOST_PANELS] if isinstance(asked, list) else ():
        if not isinstance(one, dict):
            continue
        number, kind, state = one.get("id"), one.get("kind"), one.get("state")
        if type(number) is int and isinstance(kind, str) and isinstance(state, dict):
            yield number, (kind, state)
