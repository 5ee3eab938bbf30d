"""The windows of the page: a switch for each, and their places."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import viser

from ros_visualise.ui.page.windows import Window
from ros_visualise.ui.page.worker import Worker

MAIN_WIDTH = 510
WINDOWS_WIDTH = 1700
"""Pixels on a very wide screen; narrower ones share what they have in this proportion."""
_MAIN_BESIDE_SCENE, _WINDOW_BESIDE_SCENE, _WINDOW_BESIDE_TRACK = 330, 310, 390
_COLUMN_WIDTH = 300
_TAKEN_AWAY_S = 0.2
_MOST_WITH_TEXTS = 3  # columns, so that lines of texts and formulas have room


class Room(NamedTuple):
    """The use of the page's room.

    Attributes:
        scene: the middle belongs to the scene, and windows form two columns; otherwise they fill
            the page in two rows.
        track: the scene shows only a track, and leaves more room to the windows.
    """

    scene: bool = False
    track: bool = False


def rearrange(
    gui: viser.GuiApi, windows: Sequence[Window], chosen: Sequence[Window], room: Room
) -> None:
    """Show only these windows; all are hidden first, so that browsers place them anew."""
    for window in windows:
        window.visible = False
    time.sleep(_TAKEN_AWAY_S)
    arrange(gui, windows, chosen, room)


def arrange(
    gui: viser.GuiApi, windows: Sequence[Window], chosen: Sequence[Window], room: Room
) -> None:
    """Place the chosen windows beside the main panel, whatever the browser's width.

    Docked windows share the browser's width and height; a person may drag them anywhere.
    """
    gui.main_panel.dock_left()
    panels = [window.panel for window in chosen]
    if room.scene:
        gui.main_panel.set_width(_MAIN_BESIDE_SCENE)
        columns = min(len(panels), 2)
        each = _WINDOW_BESIDE_TRACK if room.track else _WINDOW_BESIDE_SCENE
        _place(panels, columns, columns * each)
    else:
        gui.main_panel.set_width(MAIN_WIDTH)
        columns = (len(panels) + 1) // 2
        if any(window.has_texts for window in chosen):
            columns = min(columns, _MOST_WITH_TEXTS)
        _place(panels, columns, WINDOWS_WIDTH)
    for window in windows:
        window.visible = window in chosen
        window.panel.expand()  # on a phone, where each would begin as a line


def _place(panels: Sequence[viser.PanelHandle], columns: int, width: int) -> None:
    for number, panel in enumerate(panels):
        if number < columns:
            panel.dock_right()
        else:
            panel.dock_below(panels[number - columns])
    if panels:
        panels[0].set_width(_COLUMN_WIDTH)  # what every other column begins with
        panels[-1].set_width(width)  # of all columns together, when they are placed


class WindowSwitches:
    """A switch for each window, in a folder.

    New ones are on unless put aside; beside a scene, only those with texts, if any.
    """

    def __init__(self, gui: viser.GuiApi, folder: viser.GuiFolderHandle, worker: Worker) -> None:
        self._gui, self._folder, self._worker = gui, folder, worker
        self._windows: Sequence[Window] = ()
        self._room = Room()
        self._switches: dict[str, viser.GuiCheckboxHandle] = {}

    def follow(self, windows: Sequence[Window], scene: bool, track: bool = False) -> None:
        """Offer these windows; for ``scene`` and ``track`` see `Room`."""
        self._windows = windows
        self._room = self._room._replace(scene=scene, track=track)
        names = [window.name for window in windows]
        for name in self._switches.keys() - set(names):
            self._switches.pop(name).remove()
        anything = any(window.has_texts for window in windows)
        with self._folder:
            for window in windows:
                if window.name not in self._switches:
                    is_on = window.has_texts or not (scene and anything)
                    switch = self._gui.add_checkbox(window.name, is_on and not window.aside)
                    switch.on_update(self._worker.listener("windows", lambda _: self.show()))
                    self._switches[window.name] = switch

    @property
    def chosen(self) -> list[Window]:
        return [window for window in self._windows if self._switches[window.name].value]

    def begin(self) -> None:
        """Show the chosen windows of a new page."""
        arrange(self._gui, self._windows, self.chosen, self._room)

    def show(self) -> None:
        rearrange(self._gui, self._windows, self.chosen, self._room)
