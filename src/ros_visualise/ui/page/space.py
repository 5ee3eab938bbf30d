"""The controls of the 3D scene: the fixed frame, how things look, and which topics are drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from html import escape
from typing import Any

import viser

from ros_visualise.data import PointCloud
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.scene.coloring import Coloring
from ros_visualise.ui.scene.kinds import DRAWINGS, is_beside_image
from ros_visualise.ui.scene.scene import Scene

_AUTO = "auto"


class Space:
    """The elements that drive a scene, in a folder."""

    def __init__(
        self, gui: viser.GuiApi, folder: viser.GuiFolderHandle, scene: Scene, worker: Worker
    ) -> None:
        self._gui, self._scene, self._worker = gui, scene, worker
        self._switches: dict[str, list[viser.GuiInputHandle[Any]]] = {}
        with folder:
            self._frame = gui.add_dropdown(
                "fixed frame", (_AUTO,), hint="the frame that stays where it is"
            )
            self._frame.on_update(self._frame_chosen)
            self._add_view()
            self._note = gui.add_html("", visible=False)
            self._topics = gui.add_folder("topics drawn", expand_by_default=False)
            with gui.add_folder("looks", expand_by_default=False):
                self._add_looks()

    def follow(self, topics: Mapping[str, type]) -> None:
        """These are the topics from now on, and the classes of their messages."""
        drawn = {
            topic: kind
            for topic, kind in topics.items()
            if kind in DRAWINGS and not is_beside_image(topic, topics)
        }
        for topic in self._switches.keys() - drawn.keys():
            for element in self._switches.pop(topic):
                element.remove()
        with self._topics:
            for topic, kind in drawn.items():
                if topic not in self._switches:
                    self._switches[topic] = self._add_switches(topic, kind)

    def refresh(self) -> None:
        """Show which frames there are, and what cannot be drawn."""
        fixed = self._scene.frames.fixed
        self._frame.options = (_AUTO, *self._scene.frames.names)
        problems = self._scene.problems
        lines = [f"drawn in <b>{escape(fixed)}</b>"] if fixed else []
        lines += [f"{escape(topic)}: {escape(why)}" for topic, why in problems.items()]
        self._note.content = f'<div class="rv-note">{"<br>".join(lines)}</div>'
        self._note.visible = bool(lines)

    def _add_view(self) -> None:
        follow = self._gui.add_checkbox("follow the robot", True, hint="the robot stays in view")
        follow.on_update(self._posted("follow", self._set_follow))
        button = self._gui.add_button("reset view")

        @button.on_click
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:
                self._worker.post("view", self._scene.reset_view)

    def _add_looks(self) -> None:
        gui, look = self._gui, self._scene.look
        elements: dict[str, viser.GuiInputHandle[Any]] = {
            "names": gui.add_checkbox("names of frames", look.names),
            "axes_size": gui.add_slider("axes size", 0.1, 5.0, 0.1, look.axes_size, hint="m"),
            "point_size": gui.add_slider("point size", 0.01, 0.5, 0.01, look.point_size, hint="m"),
            "max_points": gui.add_slider(
                "points at most", 5000, 500_000, 5000, look.max_points, hint="of one cloud"
            ),
            "covariances": gui.add_checkbox(
                "covariances", look.covariances, hint="two standard deviations of a position"
            ),
        }
        for name, element in elements.items():
            element.on_update(self._posted(name, partial(self._set_look, name)))

    def _add_switches(self, topic: str, kind: type) -> list[viser.GuiInputHandle[Any]]:
        switch = self._gui.add_checkbox(topic, True, hint=kind.__name__)
        switch.on_update(self._posted(topic, partial(self._scene.set_visible, topic)))
        if kind is not PointCloud:
            return [switch]
        choices = [coloring.value for coloring in Coloring]
        color = self._gui.add_dropdown("colour by", choices, hint=topic)
        color.on_update(self._posted(("color", topic), partial(self._set_coloring, topic)))
        return [switch, color]

    def _posted(
        self, key: object, action: Callable[[Any], object]
    ) -> Callable[[viser.GuiEvent[Any]], Any]:
        async def moved(event: viser.GuiEvent[Any]) -> None:
            self._worker.post(("3D", key), partial(action, event.target.value))

        return moved

    async def _frame_chosen(self, event: viser.GuiEvent[Any]) -> None:
        name = event.target.value
        self._worker.post("fixed", partial(self._scene.set_fixed, None if name == _AUTO else name))

    def _set_follow(self, follows: bool) -> None:
        self._scene.view.follows = follows

    def _set_look(self, name: str, value: Any) -> None:
        self._scene.look = replace(self._scene.look, **{name: value})

    def _set_coloring(self, topic: str, name: str) -> None:
        self._scene.set_coloring(topic, Coloring(name))
