"""What people arranged on the page: what a YAML file of it holds."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Iterator, Mapping
from typing import Any

import viser

from ros_visualise.errors import UsageError
from ros_visualise.ui.arrangements import Arrangement, Value
from ros_visualise.ui.page.controls import set_value
from ros_visualise.ui.page.elements import refusal

_KINDS = (
    viser.GuiSliderHandle,
    viser.GuiNumberHandle,
    viser.GuiCheckboxHandle,
    viser.GuiTextHandle,
    viser.GuiDropdownHandle,
)
_NOT_KEPT = ("recording", "robot")
"""Folders whose elements say what to do now, not how the page is."""


class Kept:
    """Knows which elements have other values than at first, and can set them so again.

    A place is the folders and the tab in which an element is, and its label; of several the same,
    the later ones are numbered. What stands in no folder, as playback, is not kept. A value for an
    element that is not there yet waits until it is.

    Args:
        gui: of the page.
        wanted: how the page is to be arranged at first.
    """

    def __init__(self, gui: viser.GuiApi, wanted: Arrangement) -> None:
        self._gui = gui
        self._first: dict[str, Value] = {}
        self._waiting: dict[str, Any] = dict(wanted)

    def refresh(self) -> None:
        """Take in elements that are new, and set those whose value waits."""
        there = dict(self._elements())
        for place, element in there.items():
            self._first.setdefault(place, element.value)
        for place in self._waiting.keys() & there.keys():
            self._set(there[place], self._waiting.pop(place), place)

    @property
    def arrangement(self) -> dict[str, Value]:
        """The values that are not as at first."""
        return {
            place: element.value
            for place, element in self._elements()
            if element.value != self._first.get(place, element.value)
        }

    def _set(self, element: Any, value: Value, place: str) -> None:
        """As a person would: with all that follows from it.

        Raises:
            UsageError: it cannot have that value.
        """
        if reason := refusal(element, value):
            raise UsageError(f"{place}: {reason}")
        value = type(element.value)(value)
        if value == element.value:
            return
        set_value(element, value)
        for listen in element._impl.update_cb:
            heard = listen(viser.GuiEvent(None, _NOBODY, element))
            if inspect.iscoroutine(heard):
                asyncio.run(heard)

    def _elements(self) -> Iterator[tuple[str, Any]]:
        seen: dict[str, int] = {}
        for element in list(self._gui._gui_input_handle_from_uuid.values()):
            path = self._path(element)
            if not isinstance(element, _KINDS) or not path:
                continue
            place = "/".join([*path, element.label])
            seen[place] = seen.get(place, 0) + 1
            yield (place if seen[place] == 1 else f"{place} {seen[place]}"), element

    def _path(self, element: Any) -> list[str]:
        """Labels of what an element is in; empty if it is not kept."""
        path: list[str] = []
        place = element._impl.parent_container_id
        containers: Mapping[str, Any] = self._gui._container_handle_from_uuid
        while (container := containers.get(place)) is not None and place != "root":
            is_tab = isinstance(container, viser.GuiTabHandle)
            path.insert(0, container._label if is_tab else container.label or "")
            place = "root" if is_tab else container._impl.parent_container_id
        return [] if path[:1] in [[one] for one in _NOT_KEPT] else [one for one in path if one]


_NOBODY = -1  # no browser's number
