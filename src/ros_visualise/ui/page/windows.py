"""The windows of the page, one for each node."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import groupby

import viser

from ros_visualise.core.params import Spec, specs
from ros_visualise.data import Image, PointCloud
from ros_visualise.graph import Member, Node
from ros_visualise.lessons.magnifier import PixelParams
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.boxes import Boxes
from ros_visualise.ui.live.images import ImageHub
from ros_visualise.ui.page.controls import Controls, sentence
from ros_visualise.ui.page.images import Picture
from ros_visualise.ui.page.overlay import Overlay
from ros_visualise.ui.page.tools import Act, TopicText, add_actions, is_tool
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.scene.scene import Scene
from ros_visualise.ui.shown import detections_of, first_shown, images_of, texts_of

_NO_OVERLAY = "None"


class Window:
    """One node: its main parameters above its image, the others below.

    ``act`` is called with a node and its action; None: its actions are offered elsewhere.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        runtime: Runtime,
        node: Member,
        worker: Worker,
        scene: Scene,
        images: ImageHub,
        act: Act | None,
    ) -> None:
        self.name = node.name
        self.aside = node.aside
        self.picture: Picture | None = None
        self._clouds = _clouds_of(runtime, node)
        self._looks = _looks_of(node), _overlays_of(runtime, node)
        self._overlay = Overlay(runtime, scene)
        self._boxes = Boxes(runtime, lambda topic: detections_of(runtime.graph, topic))
        self._gui, self._worker = gui, worker
        self._parameters = runtime.parameters[node.name]
        self._controls = Controls(gui, node.name, self._parameters, worker)
        self.panel = gui.add_panel()
        declared = [spec for spec in specs(node.params) if not spec.restart]
        self._channel = images.channel(node.name)
        topics = images_of(node)
        main = [spec for spec in declared if not spec.group]
        with self.panel.add_tab(node.name):
            self._controls.add(main)
            first = first_shown(runtime.graph, node)
            if first is not None:
                picks = node.name if isinstance(node.params, PixelParams) else ""
                self._add_picture(runtime, topics, first, len(main), picks)
            self._notes = [TopicText(gui, runtime, topic) for topic in texts_of(node)]
            self._add_folders([spec for spec in declared if spec.group])
            if act is not None:
                add_actions(gui, worker, node, act)

    @property
    def shows_anything(self) -> bool:
        return self.picture is not None or bool(self._notes)

    @property
    def has_texts(self) -> bool:
        return bool(self._notes)

    @property
    def visible(self) -> bool:
        return bool(self.panel.visible)

    @visible.setter
    def visible(self, visible: bool) -> None:
        self.panel.visible = visible
        if self.picture is not None:
            self.picture.visible = visible

    def shows(self, node: Member, runtime: Runtime) -> bool:
        """True if a new window for this node would be the same."""
        return self._looks == (_looks_of(node), _overlays_of(runtime, node))

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

    def pick(self, across: float, down: float) -> None:
        """Choose the pixel at shares of the image's width and height."""
        if self.picture is None or not isinstance(self._parameters.current, PixelParams):
            return
        pixel = self.picture.pixel_at(across, down)
        if pixel is not None:
            self._parameters.update({"x": max(pixel[0], 0), "y": max(pixel[1], 0)})

    def _add_picture(
        self, runtime: Runtime, topics: Sequence[str], first: str, rows: int, picks: str
    ) -> None:
        chosen = None
        if len(topics) > 1:
            chosen = self._gui.add_dropdown("Image", topics, initial_value=first)
        has_boxes = any(detections_of(runtime.graph, topic) for topic in topics)
        rows += chosen is not None
        self.picture = Picture(
            self._gui, runtime, self._channel, first, rows, self._overlay, self._boxes, picks
        )
        if chosen is not None:
            chosen.on_update(
                self._worker.listener((self.name, "show"), partial(setattr, self.picture, "topic"))
            )
        if self._clouds or has_boxes:
            with self._gui.add_folder("Overlay", expand_by_default=False):
                if self._clouds:
                    self._add_overlay()
                if has_boxes:
                    self._add_boxes()

    def _add_overlay(self) -> None:
        over = self._gui.add_dropdown(
            "Point cloud",
            (_NO_OVERLAY, *self._clouds),
            hint="Points over the image, coloured by distance",
        )
        over.on_update(self._worker.listener((self.name, "overlay"), self._lay_over))

    def _lay_over(self, topic: str) -> None:
        self._overlay.topic = None if topic == _NO_OVERLAY else topic

    def _add_boxes(self) -> None:
        shown = self._gui.add_checkbox("Detections", True, hint="Outlines of detected objects")
        shown.on_update(
            self._worker.listener(
                (self.name, "detections"), partial(setattr, self._boxes, "visible")
            )
        )

    def _add_folders(self, declared: Sequence[Spec]) -> None:
        for group, members in groupby(declared, key=lambda spec: spec.group):
            with self._gui.add_folder(sentence(group), expand_by_default=False):
                self._controls.add(members)


def has_window(node: Member) -> bool:
    """True if a node has images, texts or parameters to show."""
    shows = images_of(node) or texts_of(node) or specs(node.params)
    return bool(shows) and not is_tool(node)


def _clouds_of(runtime: Runtime, node: Member) -> list[str]:
    """The clouds that can be drawn over a node's images; plots of numbers have none."""
    taken = node.type.inputs.values()
    if taken and isinstance(node, Node) and Image not in taken:
        return []
    return [name for name, topic in runtime.graph.topics.items() if topic.type is PointCloud]


def _overlays_of(runtime: Runtime, node: Member) -> object:
    found = [detections_of(runtime.graph, topic) for topic in images_of(node)]
    return _clouds_of(runtime, node), found


def _looks_of(node: Member) -> object:
    return node.name, type(node.params), images_of(node), texts_of(node)
