"""The topics of the scene: the drawing of each, and the message that waits for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import DamagedMessage, NoTransform
from ros_visualise.data import (
    CameraInfo,
    Detections3D,
    Floats,
    NavSatFix,
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
    Text,
    Transforms,
)
from ros_visualise.geometry import se3
from ros_visualise.plotting.colors import PALETTE, Color
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.drawing import Appearance, Drawing, node_name
from ros_visualise.ui.scene.drawings.markers import MarkersDrawing
from ros_visualise.ui.scene.drawings.poses import PoseDrawing
from ros_visualise.ui.scene.drawings.sensors import FixDrawing
from ros_visualise.ui.scene.frames import Frames
from ros_visualise.ui.scene.kinds import CAMERAS, DRAWINGS, is_beside_image

URDF_FILE = "--urdf"
"""The name of the robot description in a file, beside the topics."""
_ROBOT_POSES = (Odometry, PoseStamped, PoseWithCovarianceStamped, NavSatFix)


@dataclass
class SceneTopic:
    """A topic: its drawing, the message that waits to be drawn, and the one that is drawn.

    ``wanted``: nothing else shows the same; ``visible``: switched on; ``until_s``: until when a
    message waits for its own transform; ``frame``: of the message drawn; ``problem``: why the last
    one is not drawn.
    """

    kind: type
    wanted: bool = True
    visible: bool = True
    drawing: Drawing | None = None
    coloring: Enum | None = None
    waiting: Any = None
    until_s: float = 0.0
    shown: Any = None
    frame: str = ""
    problem: str = ""

    @property
    def message(self) -> Any:
        """The newest message, or None."""
        return self.waiting or self.shown

    def draw(self, drawing: Drawing, appearance: Appearance) -> None:
        message = self.waiting
        self.waiting, self.shown, self.problem = None, message, ""
        try:
            drawing.draw(message, appearance)
        except (DamagedMessage, ValueError) as error:  # such as a cloud without heights
            self.problem = str(error)

    def follow(self, frames: Frames) -> None:
        """Move a drawing that stays to where its frame is now."""
        if self.drawing is None or self.shown is None or not self.drawing.stays:
            return
        with suppress(NoTransform):
            T_fixed_frame = frames.locate(self.frame, 0)
            if not np.array_equal(T_fixed_frame, self.drawing.T_fixed_frame):
                self.drawing.place(T_fixed_frame)

    def again(self) -> None:
        """Draw the same message once more."""
        if self.drawing is not None and self.coloring is not None:
            self.drawing.coloring = self.coloring
        if self.waiting is None and self.shown is not None:
            self.waiting, self.until_s = self.shown, 0.0

    def forget(self) -> None:
        self.waiting = self.shown = None
        self.frame = self.problem = ""
        if self.drawing is not None:
            self.drawing.reset()


class SceneTopics:
    """The topics of a scene by name."""

    def __init__(self, scene: SpaceTree) -> None:
        self._scene = scene
        self._entries: dict[str, SceneTopic] = {}

    def __getitem__(self, topic: str) -> SceneTopic:
        return self._entries[topic]

    def __iter__(self) -> Iterator[tuple[str, SceneTopic]]:
        return iter(self._entries.items())

    def get(self, topic: str) -> SceneTopic | None:
        """A topic, or None if it is not drawn."""
        return self._entries.get(topic)

    def provide(self, topic: str, kind: type) -> SceneTopic:
        """A topic with messages of this class, made if need be."""
        return self._entries.setdefault(topic, SceneTopic(kind))

    def follow(self, kinds: Mapping[str, type]) -> None:
        """Draw these topics from now on; given with the classes of their messages."""
        drawn = {name: kind for name, kind in kinds.items() if kind in DRAWINGS}
        there = self._entries
        for name in there.keys() - drawn.keys():
            if (drawing := there[name].drawing) is not None:
                drawing.remove()
        self._entries = {
            name: there[name]
            if name in there and there[name].kind is kind
            else SceneTopic(kind, not is_beside_image(name, kinds), not is_aside(kind, kinds))
            for name, kind in drawn.items()
        }

    def color(self, topic: str) -> Color:
        return PALETTE[list(self._entries).index(topic) % len(PALETTE)]

    def drawing(self, topic: str) -> Drawing:
        """A topic's drawing, made when first needed."""
        entry = self._entries[topic]
        if entry.drawing is None:
            name = node_name("topics", topic)
            entry.drawing = DRAWINGS[entry.kind](self._scene, name, self.color(topic))
            entry.again()
        return entry.drawing

    def show_track(self, topic: str, places: Floats) -> None:
        """Draw the whole way of a topic, if it is drawn."""
        drawing = self.drawing(topic) if topic in self._entries else None
        if isinstance(drawing, PoseDrawing | FixDrawing):
            drawing.show_track(places)

    def is_seen(self, topic: str) -> bool:
        """True if a topic is visible at the moment."""
        entry = self._entries[topic]
        return entry.visible and entry.shown is not None and not self.is_covered(topic)

    def is_covered(self, topic: str) -> bool:
        """True if another topic shows the same: an image or an earlier topic of the same camera,
        markers of the same detections, or the robot of a file."""
        entry = self._entries[topic]
        if entry.kind is Detections3D and entry.message is not None:
            names = {one.id for one in entry.message.detections}
            return bool(names) and names <= self._texts()
        if entry.kind is Text:
            return topic != URDF_FILE and URDF_FILE in self._entries
        if entry.kind not in CAMERAS or entry.message is None:
            return False
        cameras = {name: one for name, one in self if one.kind in CAMERAS and one.visible}
        for earlier in sorted(cameras, key=lambda name: cameras[name].kind is CameraInfo):
            if earlier == topic:
                return False
            message = cameras[earlier].message
            if message and message.header.frame_id == entry.message.header.frame_id:
                return True
        return False

    def _texts(self) -> set[str]:
        drawn = [one.drawing for _, one in self if one.visible]
        return {text for one in drawn if isinstance(one, MarkersDrawing) for text in one.texts}

    def robot(self) -> Floats | None:
        """T_fixed_robot by the first odometry, else pose, else fix; None without any."""
        for kind in _ROBOT_POSES:
            for _, entry in self:
                if (
                    entry.kind is kind
                    and isinstance(entry.drawing, PoseDrawing | FixDrawing)
                    and entry.shown
                ):
                    return entry.drawing.T_fixed_frame @ entry.drawing.T_frame_body
        return None

    def extent(self, places: Mapping[str, Floats]) -> npt.NDArray[np.floating]:
        """Points (N, 3) in the fixed frame that span all drawings, or else the frames' places."""
        parts = [se3.apply(one.T_fixed_frame, one.extent()) for one in self._shown()]
        if not any(map(len, parts)):
            parts = [T[None, :3, 3] for T in places.values()]
        return np.concatenate([np.zeros((0, 3)), *parts])

    def points(self) -> npt.NDArray[np.floating]:
        """Points (N, 3) in the fixed frame that a person can click."""
        parts = [se3.apply(one.T_fixed_frame, one.points()) for one in self._shown()]
        return np.concatenate([np.zeros((0, 3)), *parts])

    def _shown(self) -> list[Drawing]:
        return [
            entry.drawing
            for _, entry in self
            if entry.drawing is not None and entry.shown is not None and entry.drawing.visible
        ]


def is_aside(kind: type, kinds: Mapping[str, type]) -> bool:
    """True if a topic is hidden at first: fixes jump, and other topics have better positions."""
    better = (Odometry, PoseStamped, PoseWithCovarianceStamped, Transforms)
    return kind is NavSatFix and any(other in better for other in kinds.values())


class DataTime:
    """The time of what is shown: the newest stamp; where ``is_live``, it goes on from there."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self.is_live = False
        self.newest_ns, self._came_s = 0, 0.0

    def see(self, stamp_ns: int) -> None:
        """Note the stamp of a message."""
        if stamp_ns > self.newest_ns:
            self.newest_ns, self._came_s = stamp_ns, self._clock()

    def forget(self) -> None:
        """Begin anew, as time jumped."""
        self.newest_ns, self._came_s = 0, 0.0

    @property
    def now_ns(self) -> int:
        """The time of the data."""
        passed_s = self._clock() - self._came_s if self.is_live else 0.0
        return self.newest_ns + round(passed_s * 1e9)
