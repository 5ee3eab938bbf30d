"""The windows of the page, one for each node, and where they stand."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import groupby
from typing import Any

import viser

from ros_visualise.data import Image
from ros_visualise.params import Spec, specs
from ros_visualise.pipelines import Node
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.page.controls import Controls
from ros_visualise.ui.page.images import Picture
from ros_visualise.ui.page.worker import Worker

MAIN_WIDTH = 510
WINDOWS_WIDTH = 1700
"""Pixels on a very wide screen; narrower ones share what they have in this proportion."""


class Window:
    """One node: its main parameters above the image that it publishes, the others below."""

    def __init__(self, gui: viser.GuiApi, runtime: Runtime, node: Node, worker: Worker) -> None:
        self.name = node.name
        self.picture: Picture | None = None
        self._gui, self._worker = gui, worker
        self._controls = Controls(gui, node.name, runtime.parameters[node.name], worker)
        self._panel = gui.add_panel()
        declared = [spec for spec in specs(node.params) if not spec.restart]
        images = [t for port, t in node.outputs.items() if node.type.outputs[port] is Image]
        main = [spec for spec in declared if not spec.group]
        with self._panel.add_tab(node.name):
            self._controls.add(main)
            if images:
                self._add_picture(runtime, images, len(main))
            self._add_folders([spec for spec in declared if spec.group])

    @property
    def visible(self) -> bool:
        """Whether it is on the page."""
        return bool(self._panel.visible)

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._panel.visible = visible
        if self.picture is not None:
            self.picture.visible = visible

    @property
    def panel(self) -> viser.PanelHandle:
        """What can be placed."""
        return self._panel

    def close(self) -> None:
        """Let go of the node's parameters."""
        self._controls.close()

    def _add_picture(self, runtime: Runtime, topics: Sequence[str], rows: int) -> None:
        chosen = self._gui.add_dropdown("show", topics) if len(topics) > 1 else None
        rows += chosen is not None
        picture = self.picture = Picture(self._gui, runtime, topics[0], rows)
        if chosen is None:
            return

        @chosen.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            picture.topic = event.target.value

    def _add_folders(self, declared: Sequence[Spec]) -> None:
        for group, members in groupby(declared, key=lambda spec: spec.group):
            with self._gui.add_folder(group, expand_by_default=False):
                self._controls.add(members)


def arrange(gui: viser.GuiApi, windows: Sequence[Window]) -> None:
    """Place the visible windows in two rows beside the main panel, however wide the browser is.

    Docked windows share the browser's width and height; a person may drag them anywhere.
    """
    gui.main_panel.dock_left()
    gui.main_panel.set_width(MAIN_WIDTH)
    panels = [window.panel for window in windows if window.visible]
    columns = (len(panels) + 1) // 2
    for number, panel in enumerate(panels):
        if number < columns:
            panel.dock_right()
        else:
            panel.dock_below(panels[number - columns])
    if panels:
        panels[-1].set_width(WINDOWS_WIDTH)  # of the whole region, when all else is placed


def add_choice(gui: viser.GuiApi, windows: Sequence[Window], worker: Worker) -> None:
    """Add a switch for each window to the present container."""
    for window in windows:
        _add_switch(gui, window, windows, worker)


def _add_switch(
    gui: viser.GuiApi, window: Window, windows: Sequence[Window], worker: Worker
) -> None:
    switch = gui.add_checkbox(window.name, True)

    def show(visible: bool) -> None:
        window.visible = visible
        arrange(gui, windows)

    @switch.on_update
    async def _(event: viser.GuiEvent[Any]) -> None:
        worker.post((window.name, "visible"), partial(show, event.target.value))
