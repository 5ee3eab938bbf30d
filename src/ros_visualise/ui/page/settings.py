"""Settings of the page that were changed: kept in its address, and saved to a YAML file."""

from __future__ import annotations

import asyncio
import inspect
import secrets
from collections.abc import Iterator, Mapping
from html import escape
from typing import Any
from urllib.parse import parse_qsl, quote, urlencode

import viser

from ros_visualise.core.errors import UsageError
from ros_visualise.ui import Arrangement, Value
from ros_visualise.ui.live.space.hub import SpaceHub
from ros_visualise.ui.page.controls import set_value
from ros_visualise.ui.page.inbound import refusal
from ros_visualise.ui.page.scripts import add_channel
from ros_visualise.ui.page.worker import Worker

_KINDS = (
    viser.GuiSliderHandle,
    viser.GuiNumberHandle,
    viser.GuiCheckboxHandle,
    viser.GuiTextHandle,
    viser.GuiDropdownHandle,
)
_NOT_KEPT = ("open", "recording", "robot")
"""Folders of commands rather than settings."""
_SWITCHES = {"True": True, "False": False}
_RENAMED = {
    "part": "playback range",
    "from": "start",
    "to": "end",
    "looks": "appearance",
    "points at most": "max points",
    "axes of frames": "frame axes",
    "names of frames": "frame names",
    "follow the robot": "follow robot",
    "on the image": "overlay",
    "show": "image",
}
"""Names in addresses and layout files of the last release, and those of today in lower case."""
_MOST_IN_ADDRESS = 4000  # characters; browsers may send little more in one text


class SettingsMemory:
    """Settings of the page from one graph to the next.

    Attributes:
        first: place -> the initial value of its element.
        run: by which browsers know that this is still the same program.
        wanted: the settings to apply next.
    """

    def __init__(self, wanted: Arrangement) -> None:
        self.first: dict[str, Value] = {}
        self.run = secrets.token_hex(8)
        self.wanted: Arrangement = wanted

    def remember(self, arrangement: Arrangement) -> None:
        """Apply these settings again; playback ranges belong to one recording."""
        self.wanted = {p: v for p, v in arrangement.items() if not p.startswith("playback range/")}


class PageSettings:
    """The elements with other values than initially; sets them again from an address or a file.

    A place is the folders and the tab of an element, and its label, in lower case; of several the
    same, the later ones are numbered. Elements outside of folders, as playback, are not kept. A
    value waits until its element exists and offers it.

    Each browser's address has these values too (``scripts/address.js``). One that is opened with an
    address applies its settings and leaves all others.
    """

    def __init__(
        self, gui: viser.GuiApi, worker: Worker, space: SpaceHub, memory: SettingsMemory
    ) -> None:
        self._gui, self._space = gui, space
        self._first, self._run = memory.first, memory.run
        self._waiting = by_name(memory.wanted)
        add_channel(gui, worker, "address", self._take_address)
        self._element = gui.add_html("")

    def take_in(self) -> None:
        """TopicText the values that elements have which are new: what is changed later is kept."""
        for place, element in self._elements():
            self._first.setdefault(place, element.value)

    def refresh(self) -> None:
        """Apply the values that wait for new elements, and send the address to browsers."""
        self.take_in()
        there = dict(self._elements())
        for place in self._waiting.keys() & there.keys():
            if _has(there[place], self._waiting[place]):
                self._set(there[place], self._waiting.pop(place), place)
        self._send_address()

    @property
    def arrangement(self) -> dict[str, Value]:
        """The values that were changed."""
        return {
            place: element.value
            for place, element in self._elements()
            if element.value != self._first.get(place, element.value)
        }

    @property
    def saved(self) -> dict[str, Value]:
        """The same, with those of the 3D view."""
        return self.arrangement | self._space.arrangement

    def _send_address(self) -> None:
        address = urlencode(self.arrangement, safe="/ ,:", quote_via=quote).replace(" ", "%20")
        if len(address) > _MOST_IN_ADDRESS:  # whole values, as many as have room
            address = address[: address.rfind("&", 0, _MOST_IN_ADDRESS)]
        content = f'<i hidden data-run="{self._run}" data-address="{escape(address)}"></i>'
        if content != self._element.content:
            self._element.content = content

    def _take_address(self, address: str, _: int) -> None:
        self._waiting = by_name(dict(parse_qsl(address, keep_blank_values=True)))
        of_scene = {p: v for p, v in self._waiting.items() if p.startswith("3d/") or p == "view"}
        if of_scene:
            self._space.apply(of_scene)
        self.refresh()

    def _set(self, element: Any, value: Value, place: str) -> None:
        """Set an element as a person would, with all consequences.

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
            place = "/".join([*path, element.label]).casefold()
            seen[place] = seen.get(place, 0) + 1
            yield (place if seen[place] == 1 else f"{place} {seen[place]}"), element

    def _path(self, element: Any) -> list[str]:
        """Labels of an element's containers; empty if it is not kept."""
        path: list[str] = []
        place = element._impl.parent_container_id
        containers: Mapping[str, Any] = self._gui._container_handle_from_uuid
        while (container := containers.get(place)) is not None and place != "root":
            is_tab = isinstance(container, viser.GuiTabHandle)
            path.insert(0, container._label if is_tab else container.label or "")
            place = "root" if is_tab else container._impl.parent_container_id
        is_kept = path and path[0].casefold() not in _NOT_KEPT
        return [one for one in path if one] if is_kept else []


_NOBODY = -1  # not a browser's number


def by_name(arrangement: Arrangement) -> dict[str, Value]:
    """Place, as it is called today -> value."""
    return {
        "/".join(_RENAMED.get(part, part) for part in place.casefold().split("/")): value
        for place, value in arrangement.items()
    }


def _has(element: Any, value: Value) -> bool:
    if not isinstance(element, viser.GuiDropdownHandle):
        return True
    return str(value).casefold() in map(str.casefold, element.options)


def _read(element: Any, text: str) -> Value:
    """An element's value for a text in an address."""
    if isinstance(element, viser.GuiCheckboxHandle):
        return _SWITCHES.get(text, text)
    if isinstance(element, viser.GuiDropdownHandle):
        return next((one for one in element.options if one.casefold() == text.casefold()), text)
    if isinstance(element, viser.GuiTextHandle):
        return text
    try:
        return float(text)
    except ValueError:
        return text
