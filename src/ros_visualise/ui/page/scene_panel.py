"""The controls of the 3D scene: the fixed frame, the look, and which topics are drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from html import escape
from typing import Any

import viser

from ros_visualise.data import Detections3D, Marker, MarkerArray, OccupancyGrid, PointCloud
from ros_visualise.plotting.colors import Color, css
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.page.pointing import Pointing
from ros_visualise.ui.page.worker import Listener, Worker
from ros_visualise.ui.scene.kinds import DRAWINGS, is_beside_image
from ros_visualise.ui.scene.scene import Scene

_AUTO = "Auto"
_SIZED = "Metres, for a robot of 1 m"
_MANY_COLORS = "linear-gradient(90deg, #30f, #2cf, #4f4, #fc2, #d20)"
_COLORED = (PointCloud, Marker, MarkerArray, Detections3D, OccupancyGrid)

_Element = viser.GuiInputHandle[Any] | viser.GuiHtmlHandle


class ScenePanel:
    """The elements that drive a scene, in a folder."""

    def __init__(
        self,
        server: viser.ViserServer,
        folder: viser.GuiFolderHandle,
        runtime: Runtime,
        scene: Scene,
        worker: Worker,
    ) -> None:
        gui = self._gui = server.gui
        self._scene, self._worker = scene, worker
        self._switches: dict[str, list[_Element]] = {}
        with folder:
            self._frame = gui.add_dropdown(
                "Fixed frame", (_AUTO,), hint="Frame that everything is drawn in"
            )
            self._frame.on_update(self._listener("fixed", self._set_fixed))
            self._add_view()
            self._pointing = Pointing(server, runtime, scene, worker)
            self._note = gui.add_html("", visible=False)
            self._topics = gui.add_folder("Legend")
            with gui.add_folder("Appearance", expand_by_default=False):
                self._add_looks()

    def follow(self, topics: Mapping[str, type], inputs: Mapping[str, type]) -> None:
        """Offer these topics, and goals on ``inputs`` of the graph; given with their types."""
        self._pointing.follow(inputs)
        drawn = {
            topic: kind
            for topic, kind in topics.items()
            if kind in DRAWINGS and not is_beside_image(topic, topics)
        }
        for topic in self._switches.keys() - drawn.keys():
            for element in self._switches.pop(topic):
                element.remove()
        self._topics.visible = bool(drawn)
        with self._topics:
            for topic, kind in drawn.items():
                if topic not in self._switches:
                    self._switches[topic] = self._add_switches(topic, kind)

    def refresh(self) -> None:
        """Show the frames, and which topics cannot be drawn."""
        scene = self._scene
        self._pointing.refresh()
        for topic, elements in self._switches.items():
            for element in elements:
                element.visible = not scene.is_covered(topic)
        self._frame.options = (_AUTO, *scene.frames.names)
        has_transforms = bool(scene.frames.tree.frames())
        lines = note(scene.frames.fixed, scene.topic_frames, scene.problems, has_transforms)
        self._note.content = f'<div class="rv-note">{"<br>".join(lines)}</div>'
        self._note.visible = bool(lines)

    def _add_view(self) -> None:
        follow = self._gui.add_checkbox("Follow robot", True, hint="Keep the robot in view")
        follow.on_update(self._listener("follow", partial(setattr, self._scene.view, "follows")))
        button = self._gui.add_button("Reset view")
        button.on_click(self._listener("view", lambda _: self._scene.reset_view()))

    def _add_looks(self) -> None:
        gui, look = self._gui, self._scene.appearance
        elements: dict[str, viser.GuiInputHandle[Any]] = {
            "axes": gui.add_checkbox("Frame axes", look.axes, hint="x red, y green, z blue"),
            "names": gui.add_checkbox(
                "Frame names",
                look.names,
                hint="Frames close to each other share a label",
            ),
            "axes_size": gui.add_slider("Axes size", 0.1, 5.0, 0.1, look.axes_size, hint=_SIZED),
            "point_size": gui.add_slider(
                "Point size", 0.01, 0.5, 0.01, look.point_size, hint=_SIZED
            ),
            "max_points": gui.add_slider(
                "Max points",
                5000,
                500_000,
                5000,
                look.max_points,
                hint="Points drawn of one cloud",
            ),
            "covariances": gui.add_checkbox(
                "Covariances", look.covariances, hint="Ellipsoids of two standard deviations"
            ),
        }
        for name, element in elements.items():
            element.on_update(self._listener(name, partial(self._set_look, name)))

    def _add_switches(self, topic: str, kind: type) -> list[_Element]:
        swatch = self._gui.add_html(_swatch(kind, self._scene.color(topic)))
        is_on = self._scene.is_visible(topic)
        switch = self._gui.add_checkbox(topic, is_on, hint=kind.__name__)
        switch.on_update(self._listener(topic, partial(self._scene.set_visible, topic)))
        colorings = DRAWINGS[kind].colorings
        if colorings is None:
            return [swatch, switch]
        choices = [coloring.value for coloring in colorings]
        color = self._gui.add_dropdown("Colour by", choices, hint=topic)
        choose = partial(self._scene.set_coloring, topic)
        color.on_update(self._listener(("color", topic), lambda name: choose(colorings(name))))
        return [swatch, switch, color]

    def _listener(self, key: object, action: Callable[[Any], object]) -> Listener:
        return self._worker.listener(("3D", key), action)

    def _set_fixed(self, name: str) -> None:
        self._scene.set_fixed(None if name == _AUTO else name)

    def _set_look(self, name: str, value: Any) -> None:
        self._scene.appearance = replace(self._scene.appearance, **{name: value})


def _swatch(kind: type, color: Color) -> str:
    """The colour of a topic, beside the switch below: HTML."""
    paint = _MANY_COLORS if kind in _COLORED else css(color)
    return f'<div class="rv-swatch"><i style="background: {paint}"></i></div>'


def note(
    fixed: str, frames: Mapping[str, str], problems: Mapping[str, str], has_transforms: bool
) -> list[str]:
    """Lines about the fixed frame and about problems: HTML.

    Args:
        fixed: the fixed frame, or empty.
        frames: topic -> the frame of its newest message.
        problems: topic -> why it is not drawn.
        has_transforms: True once any has come.
    """
    if has_transforms or not fixed:
        where = [f"Shown in <b>{escape(fixed)}</b>"] if fixed else []
        return where + [f"{escape(topic)}: {escape(why)}" for topic, why in problems.items()]
    there = [topic for topic, frame in frames.items() if frame in ("", fixed)]
    apart = [f"{topic} ({frame})" for topic, frame in frames.items() if topic not in there]
    wrong = {topic: why for topic, why in problems.items() if topic in there}
    line = (
        f"No transforms. Shown in <b>{escape(fixed)}</b>: {escape(', '.join(there)) or 'nothing'}"
    )
    if apart:
        line += f". Not shown (no transform to their frames): {escape(', '.join(apart))}"
    return [line, *(f"{escape(topic)}: {escape(why)}" for topic, why in wrong.items())]
