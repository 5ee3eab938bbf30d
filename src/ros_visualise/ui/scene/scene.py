"""The scene: the newest message of each topic, drawn in the fixed frame."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import viser

from ros_visualise.data import CameraInfo, Floats, Image, Odometry, Text, Transforms
from ros_visualise.errors import DamagedMessage, NoTransform
from ros_visualise.geometry import transforms
from ros_visualise.ui.scene.axes import Axes
from ros_visualise.ui.scene.coloring import Coloring
from ros_visualise.ui.scene.drawing import PALETTE, Drawing, Look, node_name
from ros_visualise.ui.scene.frames import Frames
from ros_visualise.ui.scene.kinds import CAMERAS, DRAWINGS, is_beside_image, is_static
from ros_visualise.ui.scene.points import Cloud
from ros_visualise.ui.scene.poses import Pose
from ros_visualise.ui.scene.robots import Robot
from ros_visualise.ui.scene.view import View

log = logging.getLogger(__name__)

_PATIENCE_S = 0.2
_NS = 1_000_000_000


@dataclass
class _Entry:
    """A topic: its drawing, the message that waits to be drawn, and the one that is."""

    kind: type
    drawn: bool = True
    visible: bool = True
    drawing: Drawing | None = None
    coloring: Coloring = Coloring.AUTO
    waiting: Any = None
    until_s: float = 0.0
    shown: Any = None
    problem: str = ""


class Scene:
    """Draws what it is shown; all of it may be called from any thread.

    A message is placed by the transform at its own stamp. It is waited a little for one that is not
    there yet; then the newest one has to do.

    Args:
        server: the page.
        clock: seconds.
    """

    def __init__(
        self, server: viser.ViserServer, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.frames = Frames()
        self.calibrations: dict[str, CameraInfo] = {}
        self._server, self._clock = server, clock
        self._entries: dict[str, _Entry] = {}
        self._look = Look()
        self._fixed = ""
        self._lock = threading.RLock()
        self.view = View(server, clock)
        self._axes = Axes(server.scene)
        self._model = Robot(server.scene)
        self._places: dict[str, Floats] = {}
        self._axes_look = self._look

    @property
    def look(self) -> Look:
        """How things are drawn; may be changed."""
        return self._look

    @look.setter
    def look(self, look: Look) -> None:
        with self._lock:
            self._look = look
            self._redraw(self._entries)

    def follow(self, topics: Mapping[str, type]) -> None:
        """These are the topics from now on, and the classes of their messages.

        Of topics on which one camera's images are, the first is the one drawn.
        """
        with self._lock:
            self.view.shown = bool(topics)
            kinds = {name: kind for name, kind in topics.items() if kind in DRAWINGS}
            for name in self._entries.keys() - kinds.keys():
                self._remove(self._entries.pop(name))
            there = self._entries
            self._entries = {
                name: there[name]
                if name in there and there[name].kind is kind
                else _Entry(kind, drawn=not is_beside_image(name, topics))
                for name, kind in kinds.items()
            }

    def show(self, topic: str, message: Any) -> None:
        """Draw a message as soon as it can be said where."""
        with self._lock:
            if isinstance(message, Transforms):
                self.frames.add(message, is_static(topic))
                return
            if isinstance(message, Text):
                self._describe(message.text)
                return
            entry = self._entries.setdefault(topic, _Entry(type(message)))
            if isinstance(message, CameraInfo):
                self.calibrations[message.header.frame_id] = message
            if isinstance(message, Image) and message.camera_info is not None:
                self.calibrations[message.header.frame_id] = message.camera_info
            self.frames.see(message.header.frame_id)
            if not entry.drawn:
                return
            entry.waiting, entry.until_s = message, self._clock() + _PATIENCE_S

    def wants(self, topic: str) -> bool:
        """Whether messages of a topic are drawn."""
        with self._lock:
            entry = self._entries.get(topic)
            return entry is not None and entry.visible and not self._is_covered(topic)

    def is_waiting(self, topic: str) -> bool:
        """Whether the last message of a topic is not drawn yet."""
        with self._lock:
            return self._entries[topic].waiting is not None

    def refresh(self) -> None:
        """Draw what has come, where it belongs."""
        with self._lock, self._server.atomic():
            if self.frames.fixed != self._fixed:
                self._fixed = self.frames.fixed
                self.view.restart()
                self._redraw(self._entries)
            for topic, entry in self._entries.items():
                if entry.waiting is not None:
                    self._try(topic, entry)
                if entry.drawing is not None:
                    entry.drawing.visible = self._is_seen(topic, entry)
            self._draw_axes()
            self._model.place(self._places)
            self.view.update(self._robot(), self._extent)

    def set_visible(self, topic: str, visible: bool) -> None:
        """Show or hide a topic."""
        with self._lock:
            self._entries[topic].visible = visible

    def set_coloring(self, topic: str, coloring: Coloring) -> None:
        """Colour a topic's points by something else."""
        with self._lock:
            self._entries[topic].coloring = coloring
            self._redraw([topic])

    def set_fixed(self, frame: str | None) -> None:
        """Draw everything in this frame; None: in the one that fits best."""
        with self._lock:
            self.frames.chosen = frame

    def reset_view(self) -> None:
        """Have everybody look from behind the robot, or at everything."""
        with self._lock:
            self.view.reset()

    @property
    def problems(self) -> dict[str, str]:
        """Topic -> why it is not drawn."""
        with self._lock:
            return {name: one.problem for name, one in self._entries.items() if one.problem}

    def _describe(self, text: str) -> None:
        try:
            self._model.describe(text)
        except ValueError as error:
            log.warning("%s", error)

    def _try(self, topic: str, entry: _Entry) -> None:
        """Draw the message that waits, unless it is worth to wait for its transform."""
        message = entry.waiting
        drawing = entry.drawing or self._make(topic, entry)
        frame = drawing.frame_of(message, self.frames)
        try:
            patient = self._clock() < entry.until_s
            T = self.frames.locate(frame, message.header.stamp_ns, patient)
        except NoTransform as error:
            if patient:
                return
            entry.waiting, entry.shown, entry.problem = None, None, str(error)
            return
        entry.waiting, entry.problem = None, ""
        self._draw(entry, drawing, message, T)

    def _draw(self, entry: _Entry, drawing: Drawing, message: Any, T: Floats) -> None:
        before = entry.shown
        if before is not None and message.header.stamp_ns < before.header.stamp_ns:
            drawing.reset()
        drawing.place(T)
        drawing.settle(message, self.frames)
        try:
            drawing.draw(message, self._look)
        except (DamagedMessage, ValueError) as error:  # such as a cloud without heights
            entry.problem = str(error)
        entry.shown = message

    def _make(self, topic: str, entry: _Entry) -> Drawing:
        color = PALETTE[list(self._entries).index(topic) % len(PALETTE)]
        name = node_name("topics", topic)
        entry.drawing = DRAWINGS[entry.kind](self._server.scene, name, color)
        if isinstance(entry.drawing, Cloud):
            entry.drawing.coloring = entry.coloring
        return entry.drawing

    def _redraw(self, topics: Sequence[str] | Mapping[str, Any]) -> None:
        """Let what is drawn be drawn again."""
        for topic in topics:
            entry = self._entries[topic]
            if isinstance(entry.drawing, Cloud):
                entry.drawing.coloring = entry.coloring
            if entry.waiting is None and entry.shown is not None:
                entry.waiting, entry.until_s = entry.shown, 0.0

    def _remove(self, entry: _Entry) -> None:
        if entry.drawing is not None:
            entry.drawing.remove()

    def _is_seen(self, topic: str, entry: _Entry) -> bool:
        return entry.visible and entry.shown is not None and not self._is_covered(topic)

    def _is_covered(self, topic: str) -> bool:
        """Whether an earlier topic shows what the same camera sees."""
        entry = self._entries[topic]
        message = entry.waiting or entry.shown
        if entry.kind not in CAMERAS or message is None:
            return False
        for earlier in sorted(self._entries, key=lambda name: self._rank(name)):
            if earlier == topic:
                return False
            other = self._entries[earlier]
            shown = other.waiting or other.shown
            is_camera = other.kind in CAMERAS and other.visible and shown is not None
            if is_camera and shown.header.frame_id == message.header.frame_id:
                return True
        return False

    def _rank(self, topic: str) -> bool:
        return self._entries[topic].kind is CameraInfo  # after the images

    def _draw_axes(self) -> None:
        places = {}
        for name in self.frames.tree.frames():
            try:
                places[name] = self.frames.locate(name, 0)
            except NoTransform:
                continue
        same = places.keys() == self._places.keys() and all(
            np.array_equal(T, self._places[name]) for name, T in places.items()
        )
        if not same or self._axes_look != self._look:
            self._places, self._axes_look = places, self._look
            self._axes.draw(places, self._look)

    def _robot(self) -> Floats | None:
        """T_fixed_robot: by its frame, else by the first odometry."""
        name = self.frames.robot
        if name in self._places:
            return self._places[name]
        for entry in self._entries.values():
            if entry.kind is Odometry and isinstance(entry.drawing, Pose) and entry.shown:
                return entry.drawing.T_fixed_frame @ entry.drawing.T_frame_body
        return None

    def _extent(self) -> npt.NDArray[np.floating]:
        """Points (N, 3) in the fixed frame that tell how large all that is drawn is."""
        parts = [
            transforms.apply(entry.drawing.T_fixed_frame, entry.drawing.extent())
            for entry in self._entries.values()
            if entry.drawing is not None and entry.shown is not None and entry.drawing.visible
        ]
        return np.concatenate([np.zeros((0, 3)), *parts])
