"""What people arranged on the page: kept in its address, and in a YAML file."""

from __future__ import annotations

import asyncio
import inspect
import secrets
from collections.abc import Iterator, Mapping
from html import escape
from typing import Any
from urllib.parse import parse_qsl, quote, urlencode

import numpy as np
import viser

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Floats
from ros_visualise.ui.arrangements import Arrangement, Value
from ros_visualise.ui.page.controls import set_value
from ros_visualise.ui.page.elements import refusal
from ros_visualise.ui.page.scripts import add_channel
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.scene.scene import Scene

_KINDS = (
    viser.GuiSliderHandle,
    viser.GuiNumberHandle,
    viser.GuiCheckboxHandle,
    viser.GuiTextHandle,
    viser.GuiDropdownHandle,
)
_NOT_KEPT = ("open", "recording", "robot")
"""Folders whose elements say what to do now, not how the page is."""
_SWITCHES = {"True": True, "False": False}
_MOST_IN_ADDRESS = 4000  # characters; browsers may send little more in one text
_VIEW, _FARTHEST_M = "view", 1e6


class Memory:
    """What is known of the page from one graph to the next.

    Args:
        wanted: how the page is to be arranged at first.

    Attributes:
        first: place -> the value that its element had at first.
        run: tells browsers that this is still the same program.
        wanted: how the page is to be arranged next.
    """

    def __init__(self, wanted: Arrangement) -> None:
        self.first: dict[str, Value] = {}
        self.run = secrets.token_hex(8)
        self.wanted: Arrangement = wanted

    def remember(self, arrangement: Arrangement) -> None:
        """Arrange the page so again; parts that were marked are those of one recording."""
        self.wanted = {p: v for p, v in arrangement.items() if not p.startswith("part/")}


class Kept:
    """Knows which elements have other values than at first, and can set them so again.

    A place is the folders and the tab in which an element is, and its label; of several the same,
    the later ones are numbered. What stands in no folder, as playback, is not kept. A value for an
    element that is not there yet waits until it is, and one for a choice until there is that to
    choose.

    Each browser's address has these values too (``scripts/address.js``). One that is opened with an
    address sets what this names; all else stays as it is.

    Args:
        gui: of the page.
        worker: sets what the address of a browser names.
        scene: what each browser has its own view of.
        memory: of the graph that was shown before.
    """

    def __init__(self, gui: viser.GuiApi, worker: Worker, scene: Scene, memory: Memory) -> None:
        self._gui, self._scene = gui, scene
        self._first, self._run = memory.first, memory.run
        self._waiting: dict[str, Value] = dict(memory.wanted)
        if _VIEW in self._waiting:
            scene.look_from(None, *_places(str(self._waiting.pop(_VIEW))))
        add_channel(gui, worker, "address", self._take_address)
        add_channel(gui, worker, _VIEW, self._take_view)
        self._element = gui.add_html("")

    def take_in(self) -> None:
        """Note the values that elements have which are new: what is changed later is kept."""
        for place, element in self._elements():
            self._first.setdefault(place, element.value)

    def refresh(self) -> None:
        """Take in elements that are new, set those whose value waits, and tell the browsers."""
        self.take_in()
        there = dict(self._elements())
        for place in self._waiting.keys() & there.keys():
            if _has(there[place], self._waiting[place]):
                self._set(there[place], self._waiting.pop(place), place)
        self._tell()

    @property
    def arrangement(self) -> dict[str, Value]:
        """The values that are not as at first."""
        return {
            place: element.value
            for place, element in self._elements()
            if element.value != self._first.get(place, element.value)
        }

    @property
    def saved(self) -> dict[str, Value]:
        """The same, and the view in 3D where somebody moved it."""
        moved = self._scene.view.moved
        if moved is None:
            return self.arrangement
        view = ",".join(f"{xyz:.2f}" for place in moved for xyz in place)
        return self.arrangement | {_VIEW: view}

    def _tell(self) -> None:
        address = urlencode(self.arrangement, safe="/ ,:", quote_via=quote).replace(" ", "%20")
        if len(address) > _MOST_IN_ADDRESS:  # whole values, as many as have room
            address = address[: address.rfind("&", 0, _MOST_IN_ADDRESS)]
        anchor = ",".join(f"{xyz:.3f}" for xyz in self._scene.anchor)
        content = (
            f'<i hidden data-run="{self._run}" data-address="{escape(address)}"'
            f' data-anchor="{anchor}"></i>'
        )
        if content != self._element.content:
            self._element.content = content

    def _take_address(self, address: str, _: int) -> None:
        self._waiting = dict(parse_qsl(address, keep_blank_values=True))
        self.refresh()

    def _take_view(self, told: str, client: int) -> None:
        self._scene.look_from(client, *_places(told))

    def _set(self, element: Any, value: Value, place: str) -> None:
        """As a person would: with all that follows from it.

        Raises:
            UsageError: it cannot have that value.
        """
        value = _read(element, value) if isinstance(value, str) else value
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


def _places(view: str) -> tuple[Floats, Floats]:
    """Where a view is from, and what it looks at: (3,) metres each.

    Raises:
        UsageError: these are no six numbers.
    """
    try:
        numbers = [float(text) for text in view.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 6 or not all(abs(xyz) < _FARTHEST_M for xyz in numbers):
        raise UsageError(f"{_VIEW}: give six numbers, in metres: x,y,z,x,y,z")
    return np.array(numbers[:3]), np.array(numbers[3:])


def _has(element: Any, value: Value) -> bool:
    return not isinstance(element, viser.GuiDropdownHandle) or value in element.options


def _read(element: Any, text: str) -> Value:
    """The value that a text in an address means for an element."""
    if isinstance(element, viser.GuiCheckboxHandle):
        return _SWITCHES.get(text, text)
    if isinstance(element, viser.GuiTextHandle | viser.GuiDropdownHandle):
        return text
    try:
        return float(text)
    except ValueError:
        return text
