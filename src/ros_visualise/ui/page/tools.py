"""Nodes with nothing to set and no image to show: their buttons and texts, in the main panel."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import viser

from ros_visualise.core.params import specs
from ros_visualise.graph import Graph, Member
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.page.note import Note
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.shown import images_of, texts_of

Act = Callable[[str, str], None]
"""Given a node and its action, does it."""


class Tools:
    """A folder for each such node."""

    def __init__(self, gui: viser.GuiApi, runtime: Runtime, worker: Worker, act: Act) -> None:
        self._gui, self._runtime, self._worker, self._act = gui, runtime, worker, act
        self._folders: list[viser.GuiFolderHandle] = []
        self._notes: list[Note] = []

    def follow(self, graph: Graph) -> None:
        """Offer those of this graph from now on."""
        self.rest()
        for folder in self._folders:
            folder.remove()
        nodes = list(filter(is_tool, graph.members))
        self._folders = [self._gui.add_folder(node.name) for node in nodes]
        self._notes = []
        for folder, node in zip(self._folders, nodes, strict=True):
            with folder:
                add_actions(self._gui, self._worker, node, self._act)
                self._notes += [Note(self._gui, self._runtime, text) for text in texts_of(node)]

    def refresh(self) -> None:
        """Show the newest texts."""
        for note in self._notes:
            note.refresh()

    def rest(self) -> None:
        """Ask for no texts until the next `refresh`."""
        for note in self._notes:
            note.rest()


def is_tool(node: Member) -> bool:
    """Whether a window would show nothing but a button."""
    return bool(node.type.actions) and not images_of(node) and not specs(node.params)


def add_actions(gui: viser.GuiApi, worker: Worker, node: Member, act: Act) -> None:
    """A button for each action of a node, in the present container."""
    for name, help in node.type.actions.items():
        button = gui.add_button(name.replace("_", " "), hint=help)
        button.on_click(worker.listener(None, partial(_press, act, node.name, name)))


def _press(act: Act, node: str, action: str, _: object) -> None:
    act(node, action)
