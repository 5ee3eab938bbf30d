"""The windows of the page, one for each node, and where they stand."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby
from typing import Any

import viser

from ros_visualise.data import PointCloud
from ros_visualise.graph import Node
from ros_visualise.params import Spec, specs
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.page.controls import Controls
from ros_visualise.ui.page.images import Picture
from ros_visualise.ui.page.overlay import Overlay
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.scene.scene import Scene
from ros_visualise.ui.shown import first_shown, images_of

MAIN_WIDTH = 510
WINDOWS_WIDTH = 1700
"""Pixels on a very wide screen; narrower ones share what they have in this proportion."""
_MAIN_BESIDE_SCENE, _WINDOW_BESIDE_SCENE = 330, 310
_NO_OVERLAY = "none"
_COLUMN_WIDTH = 300
_TAKEN_AWAY_S = 0.2


class Window:
    """One node: its main parameters above the image that it publishes, the others below."""

    def __init__(
        self,
        gui: viser.GuiApi,
        runtime: Runtime,
        node: Node,
        worker: Worker,
        scene: Scene,
        act: Callable[[str, str], None],
    ) -> None:
        self.name = node.name
        self.picture: Picture | None = None
        self._clouds = _clouds_of(runtime)
        self._looks = _looks_of(node), self._clouds
        self._overlay = Overlay(runtime, scene)
        self._gui, self._worker = gui, worker
        self._controls = Controls(gui, node.name, runtime.parameters[node.name], worker)
        self._panel = gui.add_panel()
        declared = [spec for spec in specs(node.params) if not spec.restart]
        images = images_of(node)
        main = [spec for spec in declared if not spec.group]
        with self._panel.add_tab(node.name):
            self._controls.add(main)
            first = first_shown(runtime.graph, node)
            if first is not None:
                self._add_picture(runtime, images, first, len(main))
            self._add_folders([spec for spec in declared if spec.group])
            self._add_actions(node, act)

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

    def shows(self, node: Node, runtime: Runtime) -> bool:
        """Whether a window made for this node would be just like it."""
        return self._looks == (_looks_of(node), _clouds_of(runtime))

    def close(self) -> None:
        """Let go of the node's parameters."""
        self._controls.close()

    def remove(self) -> None:
        """Take it off the page for good."""
        self.close()
        self._panel.remove()

    def _add_picture(self, runtime: Runtime, topics: Sequence[str], first: str, rows: int) -> None:
        chosen = None
        if len(topics) > 1:
            chosen = self._gui.add_dropdown("show", topics, initial_value=first)
        rows += (chosen is not None) + bool(self._clouds)
        self._add_overlay()
        picture = self.picture = Picture(self._gui, runtime, first, rows, self._overlay)
        if chosen is None:
            return

        @chosen.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            picture.topic = event.target.value

    def _add_actions(self, node: Node, act: Callable[[str, str], None]) -> None:
        for name, help in node.type.actions.items():
            button = self._gui.add_button(name.replace("_", " "), hint=help)
            button.on_click(partial(self._clicked, partial(act, node.name, name)))

    async def _clicked(self, action: Callable[[], None], event: viser.GuiEvent[Any]) -> None:
        if event.client_id is not None:
            self._worker.post(object(), action)

    def _add_overlay(self) -> None:
        if not self._clouds:
            return
        over = self._gui.add_dropdown(
            "overlay", (_NO_OVERLAY, *self._clouds), hint="points over the image, by distance"
        )

        @over.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            topic = event.target.value
            self._overlay.topic = None if topic == _NO_OVERLAY else topic

    def _add_folders(self, declared: Sequence[Spec]) -> None:
        for group, members in groupby(declared, key=lambda spec: spec.group):
            with self._gui.add_folder(group, expand_by_default=False):
                self._controls.add(members)


def has_window(node: Node) -> bool:
    """Whether a node has anything to show: images, parameters or actions."""
    return bool(images_of(node) or specs(node.params) or node.type.actions)


def _clouds_of(runtime: Runtime) -> list[str]:
    """The topics whose points can be drawn over images."""
    return [name for name, topic in runtime.graph.topics.items() if topic.type is PointCloud]


def _looks_of(node: Node) -> object:
    return node.name, type(node.params), images_of(node)


def rearrange(
    gui: viser.GuiApi, windows: Sequence[Window], chosen: Sequence[Window], scene: bool
) -> None:
    """Show these windows alone.

    All are taken away first: browsers place a window that comes back as they do on loading.
    """
    for window in windows:
        window.visible = False
    time.sleep(_TAKEN_AWAY_S)
    arrange(gui, windows, chosen, scene)


def arrange(
    gui: viser.GuiApi, windows: Sequence[Window], chosen: Sequence[Window], scene: bool
) -> None:
    """Place the windows beside the main panel, however wide the browser is.

    Docked windows share the browser's width and height; a person may drag them anywhere.

    Args:
        gui: the page.
        windows: all.
        chosen: those that are shown.
        scene: the middle belongs to the scene, and they make two columns; else they fill the page
            in two rows.
    """
    gui.main_panel.dock_left()
    panels = [window.panel for window in chosen]
    if scene:
        gui.main_panel.set_width(_MAIN_BESIDE_SCENE)
        columns = min(len(panels), 2)
        _place(panels, columns, columns * _WINDOW_BESIDE_SCENE)
    else:
        gui.main_panel.set_width(MAIN_WIDTH)
        _place(panels, (len(panels) + 1) // 2, WINDOWS_WIDTH)
    for window in windows:
        window.visible = window in chosen


def _place(panels: Sequence[viser.PanelHandle], columns: int, width: int) -> None:
    for number, panel in enumerate(panels):
        if number < columns:
            panel.dock_right()
        else:
            panel.dock_below(panels[number - columns])
    if panels:
        panels[0].set_width(_COLUMN_WIDTH)  # what every other column begins with
        panels[-1].set_width(width)  # of all columns together, when they are placed


class Choice:
    """A switch for each window, in a folder.

    Those added are on; beside a scene, where there is less room, those with images are, if any.
    """

    def __init__(self, gui: viser.GuiApi, folder: viser.GuiFolderHandle, worker: Worker) -> None:
        self._gui, self._folder, self._worker = gui, folder, worker
        self._windows: Sequence[Window] = ()
        self._scene = False
        self._switches: dict[str, viser.GuiCheckboxHandle] = {}

    def follow(self, windows: Sequence[Window], scene: bool) -> None:
        """These are the windows from now on.

        Args:
            windows: all.
            scene: whether the middle of the page belongs to the scene.
        """
        self._windows, self._scene = windows, scene
        names = [window.name for window in windows]
        for name in self._switches.keys() - set(names):
            self._switches.pop(name).remove()
        pictures = any(window.picture is not None for window in windows)
        with self._folder:
            for window in windows:
                if window.name not in self._switches:
                    is_on = window.picture is not None or not (scene and pictures)
                    switch = self._gui.add_checkbox(window.name, is_on)
                    switch.on_update(self._switched)
                    self._switches[window.name] = switch

    @property
    def chosen(self) -> list[Window]:
        """The windows that are shown."""
        return [window for window in self._windows if self._switches[window.name].value]

    def show(self) -> None:
        """Show the chosen windows alone."""
        rearrange(self._gui, self._windows, self.chosen, self._scene)

    async def _switched(self, _: viser.GuiEvent[Any]) -> None:
        self._worker.post("windows", self.show)
