"""The windows of the page, one for each node."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import viser

from ros_visualise.core.params import Spec, specs
from ros_visualise.graph import Member
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.page.controls import Controls, sentence
from ros_visualise.ui.page.tools import Act, TopicText, add_actions, is_tool
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.shown import texts_of


class Window:
    """One node: its main parameters, its texts, and its other parameters.

    ``act`` is called with a node and its action; None: its actions are offered elsewhere.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        runtime: Runtime,
        node: Member,
        worker: Worker,
        act: Act | None,
    ) -> None:
        self.name = node.name
        self.aside = node.aside
        self._looks = _looks_of(node)
        self._gui, self._worker = gui, worker
        self._parameters = runtime.parameters[node.name]
        self._controls = Controls(gui, node.name, self._parameters, worker)
        self.panel = gui.add_panel()
        declared = [spec for spec in specs(node.params) if not spec.restart]
        main = [spec for spec in declared if not spec.group]
        with self.panel.add_tab(node.name):
            self._controls.add(main)
            self._notes = [TopicText(gui, runtime, topic) for topic in texts_of(node)]
            self._add_folders([spec for spec in declared if spec.group])
            if act is not None:
                add_actions(gui, worker, node, act)

    @property
    def has_texts(self) -> bool:
        return bool(self._notes)

    @property
    def visible(self) -> bool:
        return bool(self.panel.visible)

    @visible.setter
    def visible(self, visible: bool) -> None:
        self.panel.visible = visible

    def shows(self, node: Member) -> bool:
        """True if a new window for this node would be the same."""
        return self._looks == _looks_of(node)

    def refresh(self) -> None:
        for note in self._notes:
            note.refresh() if self.visible else note.rest()

    def rest(self) -> None:
        for note in self._notes:
            note.rest()

    def close(self) -> None:
        """Stop following the node's parameters and texts."""
        self._controls.close()
        self.rest()

    def remove(self) -> None:
        self.close()
        self.panel.remove()

    def _add_folders(self, declared: Sequence[Spec]) -> None:
        for group, members in groupby(declared, key=lambda spec: spec.group):
            with self._gui.add_folder(sentence(group), expand_by_default=False):
                self._controls.add(members)


def has_window(node: Member) -> bool:
    """True if a node has texts or parameters to show."""
    shows = texts_of(node) or specs(node.params)
    return bool(shows) and not is_tool(node)


def _looks_of(node: Member) -> object:
    return node.name, type(node.params), texts_of(node)
