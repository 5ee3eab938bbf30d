"""Texts of nodes; folders for nodes that have only buttons and texts."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import viser

from ros_visualise.core.params import specs
from ros_visualise.data import Text
from ros_visualise.graph import Graph, Member
from ros_visualise.lessons.prose import to_html
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.page.controls import sentence
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.shown import images_of, texts_of

Act = Callable[[str, str], None]
"""Called with a node and its action."""


class ActionPanels:
    """A folder for each node that has buttons and texts only."""

    def __init__(self, gui: viser.GuiApi, runtime: Runtime, worker: Worker, act: Act) -> None:
        self._gui, self._runtime, self._worker, self._act = gui, runtime, worker, act
        self._folders: list[viser.GuiFolderHandle] = []
        self._notes: list[TopicText] = []

    def follow(self, graph: Graph) -> None:
        self.rest()
        for folder in self._folders:
            folder.remove()
        nodes = list(filter(is_tool, graph.members))
        self._folders = [self._gui.add_folder(node.name) for node in nodes]
        self._notes = []
        for folder, node in zip(self._folders, nodes, strict=True):
            with folder:
                add_actions(self._gui, self._worker, node, self._act)
                self._notes += [
                    TopicText(self._gui, self._runtime, text) for text in texts_of(node)
                ]

    def refresh(self) -> None:
        for note in self._notes:
            note.refresh()

    def rest(self) -> None:
        for note in self._notes:
            note.rest()


def is_tool(node: Member) -> bool:
    """True if a window would show buttons only."""
    return bool(node.type.actions) and not images_of(node) and not specs(node.params)


def add_actions(gui: viser.GuiApi, worker: Worker, node: Member, act: Act) -> None:
    """A button for each action of a node, in the present container."""
    for name, help in node.type.actions.items():
        button = gui.add_button(sentence(name), hint=help)
        button.on_click(worker.listener(None, partial(_press, act, node.name, name)))


def _press(act: Act, node: str, action: str, _: object) -> None:
    act(node, action)


class TopicText:
    """The newest text of a topic, in the present container; never shown as markup."""

    def __init__(self, gui: viser.GuiApi, runtime: Runtime, topic: str) -> None:
        self._topic = topic
        self._feed = Feed(runtime)
        self._shown = ""
        self._element = gui.add_html("")

    def refresh(self) -> None:
        self._feed.follow(self._topic)
        message = self._feed.take()
        if isinstance(message, Text) and message.text != self._shown:
            self._shown = message.text
            self._element.content = f'<div class="rv-text">{to_html(message.text)}</div>'

    def rest(self) -> None:
        self._feed.follow(None)
