"""The scene: the newest message of each topic, drawn in the fixed frame."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping
from enum import Enum
from functools import partial
from typing import Any

import numpy as np

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import CameraInfo, Floats, Imu, JointState, Text, Transforms
from ros_visualise.data.poses import is_static
from ros_visualise.geometry import se3
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.axes import FrameAxes
from ros_visualise.ui.scene.drawing import Appearance
from ros_visualise.ui.scene.frames import Frames
from ros_visualise.ui.scene.kinds import DRAWINGS
from ros_visualise.ui.scene.picking import Ray, pick
from ros_visualise.ui.scene.topics import URDF_FILE, DataTime, SceneTopic, SceneTopics
from ros_visualise.ui.scene.view import SceneView

log = logging.getLogger(__name__)

_PATIENCE_S = 0.2
_AWAITED_S = 2.0  # after a time jump, for the frame in which all was drawn


class Scene:
    """Draws messages; safe to call from any thread.

    A message is placed by the transform at its own stamp; if that does not come within a moment, by
    the newest one. ``urdf`` is a robot to draw in place of those that topics describe.
    """

    def __init__(
        self,
        tree: SpaceTree,
        clock: Callable[[], float] = time.monotonic,
        urdf: str = "",
    ) -> None:
        self.frames = Frames()
        self.calibrations: dict[str, CameraInfo] = {}  # by the frames of their cameras
        self._tree, self._clock, self._urdf = tree, clock, urdf
        self._topics = SceneTopics(tree)
        self._appearance = Appearance()
        self._size_m, self._known = 1.0, 0  # of the robot, and of how many frames
        self.time = DataTime(clock)
        self._fixed = ""
        self._lock = threading.RLock()
        self.view = SceneView(tree, clock)
        self._axes = FrameAxes(tree)
        self._places: dict[str, Floats] = {}
        self._forgot_s = 0.0
        self._reported: set[str] = set()  # topics with a reported problem

    @property
    def appearance(self) -> Appearance:
        return self._appearance

    @appearance.setter
    def appearance(self, appearance: Appearance) -> None:
        with self._lock:
            self._appearance = appearance
            self._redraw()

    def follow(self, topics: Mapping[str, type]) -> None:
        """Draw these topics from now on, of one camera's only the first; given with their types."""
        with self._lock:
            self.view.shown = bool(topics)
            has_file = bool(self._urdf and topics)
            self._topics.follow({**topics, URDF_FILE: Text} if has_file else topics)
            if has_file and self._topics[URDF_FILE].message is None:
                self._take(URDF_FILE, Text(self._urdf))

    def show(self, topic: str, message: Any) -> None:
        """Draw a message as soon as it can be located."""
        with self._lock:
            self.time.see(message.header.stamp_ns)
            if isinstance(message, Transforms):
                self.add_frames(topic, message)
            elif isinstance(message, JointState):
                self.frames.joints.update(message.positions_by_name)
            else:
                self._take(topic, message)

    def add_frames(self, topic: str, message: Transforms | CameraInfo) -> None:
        """Add transforms or a calibration, which does not wait while the scene is drawn."""
        self.time.see(message.header.stamp_ns)
        if isinstance(message, CameraInfo):
            self.calibrations[message.header.frame_id] = message
            return
        for what in self.frames.add(message, is_static(topic)):
            log.warning("%s: %s (further occurrences suppressed)", topic, what)

    def show_track(self, topic: str, places: Floats) -> None:
        """Draw the whole way of a topic of poses or fixes, faintly; see `whole_tracks`."""
        with self._lock:
            self._topics.show_track(topic, places)

    def wants(self, topic: str) -> bool:
        with self._lock:
            entry = self._topics.get(topic)
            return entry is not None and entry.visible and not self._topics.is_covered(topic)

    def is_waiting(self, topic: str) -> bool:
        """True while the last message of a topic waits for its transform."""
        with self._lock:
            entry = self._topics[topic]
            return entry.waiting is not None and self._clock() < entry.until_s

    def forget(self) -> None:
        """Remove all drawings, as time jumped: by a seek, or because a recording starts over."""
        with self._lock:
            self.time.forget()
            self.frames.forget()
            self._forgot_s = self._clock()
            for _, entry in self._topics:
                entry.forget()

    def refresh(self) -> None:
        with self._lock, self._tree.atomic():
            if self._clock() - self._forgot_s > _AWAITED_S:
                self.frames.awaited = ""
            if self.frames.fixed != self._fixed:
                self._fixed = self.frames.fixed
                self.view.restart()
                self._redraw()
            for topic, entry in self._topics:
                self._update(topic, entry)
            self._places = self.frames.places()
            self._measure()
            if self._axes.draw(self._places, self._appearance.for_robot(self._size_m)):
                self.view.offer(self._places)
            self.view.update(self._robot(), partial(self._topics.extent, self._places))

    def pick(self, ray: Ray) -> Floats | None:
        """The clicked point (3,) in the fixed frame; None for the sky."""
        with self._lock:
            return pick(ray, self._topics.points())

    @property
    def robot_xyz(self) -> Floats | None:
        """The robot's position in the fixed frame, (3,) metres, or None."""
        with self._lock:
            T_fixed_robot = self._robot()
            return None if T_fixed_robot is None else T_fixed_robot[:3, 3]

    def color(self, topic: str) -> Color:
        with self._lock:
            return self._topics.color(topic)

    def is_covered(self, topic: str) -> bool:
        """True if another topic shows the same."""
        with self._lock:
            return self._topics.is_covered(topic)

    def is_visible(self, topic: str) -> bool:
        """True if a topic is switched on."""
        with self._lock:
            return self._topics[topic].visible

    def set_visible(self, topic: str, visible: bool) -> None:
        with self._lock:
            self._topics[topic].visible = visible

    def set_coloring(self, topic: str, coloring: Enum) -> None:
        """Choose a topic's colour scheme, one of its drawing's ``colorings``."""
        with self._lock:
            self._topics[topic].coloring = coloring
            self._topics[topic].again()

    def coloring(self, topic: str) -> Enum | None:
        """A topic's colour scheme; None where it has no choice of them."""
        with self._lock:
            entry = self._topics[topic]
            colorings = DRAWINGS[entry.kind].colorings
            return None if colorings is None else entry.coloring or next(iter(colorings))

    def set_fixed(self, frame: str | None) -> None:
        """Choose the fixed frame; None: automatically."""
        with self._lock:
            self.frames.chosen = frame

    def reset_view(self, for_all: bool = True) -> None:
        """Compute the view anew; see `SceneView.reset`."""
        with self._lock:
            self.view.reset(for_all)

    @property
    def problems(self) -> dict[str, str]:
        """Topic -> why it is not drawn."""
        with self._lock:
            return {name: entry.problem for name, entry in self._topics if entry.problem}

    @property
    def topic_frames(self) -> dict[str, str]:
        """Topic -> the frame of its newest message; an empty name is the fixed frame."""
        with self._lock:
            return {name: entry.frame for name, entry in self._topics if entry.message is not None}

    def _take(self, topic: str, message: Any) -> None:
        entry = self._topics.provide(topic, type(message))
        if entry.kind is not Text:
            self.frames.see(message.header.frame_id, topic)
        if DRAWINGS[entry.kind].gathers:
            self._topics.drawing(topic).gather(message, self.time.now_ns)
        if entry.wanted:
            entry.waiting, entry.until_s = message, self._clock() + _PATIENCE_S

    def _measure(self) -> None:
        """Size axes and points by the robot, as far as it is known."""
        if len(self._places) == self._known:
            return
        self._known = len(self._places)
        size_m = self.frames.robot_size_m(self._places)
        if size_m != self._size_m:
            self._size_m = size_m
            self._redraw()

    def _redraw(self) -> None:
        for _, entry in self._topics:
            entry.again()

    def _update(self, topic: str, entry: SceneTopic) -> None:
        """Draw a topic; whatever fails, the others are drawn."""
        try:
            if entry.waiting is not None:
                self._try(topic, entry)
            else:
                entry.follow(self.frames)
            if entry.drawing is not None:
                if entry.drawing.gathers:
                    entry.problem = entry.drawing.update(self.frames, self.time.now_ns)
                entry.drawing.visible = self._topics.is_seen(topic)
        except Exception as error:
            entry.waiting = None
            entry.problem = f"{type(error).__name__}: {error}"
            self._report(topic, entry.problem, error)

    def _report(self, topic: str, what: str, bug: Exception | None = None) -> None:
        if topic not in self._reported:
            self._reported.add(topic)
            log.warning(
                "%s not drawn: %s (further occurrences suppressed)", topic, what, exc_info=bug
            )

    def _try(self, topic: str, entry: SceneTopic) -> None:
        """Draw the waiting message, unless its transform may still come."""
        message, drawing = entry.waiting, self._topics.drawing(topic)
        entry.frame = drawing.frame_of(message, self.frames)
        stamp_ns = 0 if drawing.stays else message.header.stamp_ns
        patient = self._clock() < entry.until_s
        try:
            T = self._locate(entry, stamp_ns, patient)
        except NoTransform as error:
            if not patient:  # it is drawn when its frame is known, unless another comes before
                entry.shown, entry.problem = None, str(error)
            return
        drawing.place(T)
        drawing.settle(message, self.frames)
        entry.draw(drawing, self._appearance.for_robot(self._size_m))
        if entry.problem:
            self._report(topic, entry.problem)

    def _locate(self, entry: SceneTopic, stamp_ns: int, patient: bool) -> Floats:
        """T_fixed_frame of a topic; without any transforms, an IMU is where topics have the robot.

        Raises:
            NoTransform: it is unknown.
        """
        is_imu = entry.kind is Imu and not self.frames.links.all()
        robot = self._topics.robot() if is_imu else None
        if robot is not None:
            return se3.from_parts(np.eye(3), robot[:3, 3])
        return self.frames.locate(entry.frame, stamp_ns, patient)

    def _robot(self) -> Floats | None:
        """T_fixed_robot: by its frame, else by the first odometry, else by the frame that moves."""
        name = self.frames.robot
        if name in self._places:
            return self._places[name]
        by_topic = self._topics.robot()
        return self._places.get(self.frames.mover or "") if by_topic is None else by_topic
