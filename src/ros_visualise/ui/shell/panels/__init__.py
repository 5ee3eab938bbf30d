"""Panels of the page: a file for each, beside the JavaScript that shows it in a browser.

Another package brings one by an entry point of the group ``ros_visualise.panels``; see
`ros_visualise.core.registry`.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import Any, ClassVar

from nicegui.element import Element

from ros_visualise.core.errors import UsageError
from ros_visualise.core.registry import Registry


class Panel(Element):
    """One panel in one browser; it is made when a person opens it.

    What it shows and does goes over WebSockets that know who may only look. Its JavaScript gets
    ``readOnly`` and ``state``: what it kept in the page's address by ``rv.keep``.

    Attributes:
        title: on its tab, unless its state has a topic.
        help: what it shows and does, for its button and the search.
        icon: on the button that opens it, by its name among Material Icons.
        side: where it opens: left, middle, right or bottom, with others of this side.
        many: several can be open at once.
    """

    title: ClassVar[str]
    icon: ClassVar[str]
    help: ClassVar[str] = ""
    side: ClassVar[str] = "right"
    many: ClassVar[bool] = False

    def __init__(self, state: Mapping[str, Any], read_only: bool) -> None:
        super().__init__()
        self._props["state"], self._props["read-only"] = dict(state), read_only


def kinds() -> dict[str, dict[str, object]]:
    """Name -> title, icon, help, side and many, of all panels that can be opened."""
    shown = ("title", "icon", "help", "side", "many")
    return {
        name: {one: getattr(PANELS.find(name), one) for one in shown} for name in PANELS.names()
    }


def _read(held: Any, name: str) -> type[Panel]:
    candidates = vars(held).values() if isinstance(held, ModuleType) else [held]
    kinds = [one for one in candidates if isinstance(one, type) and issubclass(one, Panel)]
    found = [kind for kind in kinds if "title" in vars(kind)]
    if not found:
        raise UsageError("contains no Panel with a title")
    return found[0]


PANELS = Registry("panels", __name__, _read)
