"""The 3D view of one graph: its scene, the thread that draws it, and what people do in it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np

from ros_visualise.core import supervision
from ros_visualise.core.errors import UsageError
from ros_visualise.data import Floats, Header, Imu, PoseStamped
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.controls import SceneControls, notes
from ros_visualise.ui.scene.drawing import Appearance
from ros_visualise.ui.scene.kinds import CAMERAS, is_tree
from ros_visualise.ui.scene.picking import Ray
from ros_visualise.ui.scene.scene import Scene
from ros_visualise.ui.scene.thread import SceneThread, topics_of
from ros_visualise.ui.scene.tracks import whole_tracks
from ros_visualise.ui.worker import PageWorker

_PERIOD_S = 0.2

ShownSpace: TypeAlias = "Callable[[], ShownScene | None]"
"""Returns what is shown now, if anything is."""


class ShownScene:
    """Draws a runtime's graph into a tree, and does what browsers ask on a thread of its own.

    Args:
        is_watched: True while a browser shows it.
        say: called with the reason of a rejection.
        tell: called with the state when it may have changed.
    """

    def __init__(
        self,
        runtime: Runtime,
        tree: SpaceTree,
        urdf: str,
        is_watched: Callable[[], bool],
        say: Callable[[str], None],
        tell: Callable[[Mapping[str, Any]], None],
    ) -> None:
        self.scene = Scene(tree, urdf=urdf)
        self.controls = SceneControls(self.scene)
        self._tree = tree
        self.worker = PageWorker(say, self._refresh, _PERIOD_S)
        self._runtime, self._is_watched, self._tell = runtime, is_watched, tell
        self._graph, self._closed = runtime.graph, False
        self.scene.appearance = Appearance(names=is_tree(topics_of(self._graph)))
        self.drawing = SceneThread(runtime, self.scene, is_watched, self._unthrottled)
        self._follow()
        self.worker.start()
        self.drawing.start()
        supervision.start("tracks", self._read_tracks)

    def close(self, timeout_s: float) -> None:
        """End the threads, each within the given time."""
        self._closed = True
        self.worker.close(timeout_s)
        self.drawing.close(timeout_s)

    def pick(self, ray: Ray, goal: str) -> tuple[Floats | None, str]:
        """The clicked point (3,) or None, and the frame in which it is.

        Args:
            ray: where a person clicked.
            goal: the topic to send the robot there by; empty for none.

        Raises:
            UsageError: the topic is unknown.
        """
        place, fixed = self.scene.pick(ray), self.scene.frames.fixed
        if goal and place is not None:
            self._send(goal, place, fixed)
        return place, fixed

    @property
    def goals(self) -> list[str]:
        """Topics that take goals."""
        return [name for name, kind in self._graph.inputs.items() if kind is PoseStamped]

    def _read_tracks(self) -> None:
        while not (self._closed or self._is_watched()):
            time.sleep(_PERIOD_S)
        for topic, places in whole_tracks(self._runtime, lambda: self._closed):
            self.scene.show_track(topic, places)

    def _send(self, topic: str, place: Floats, fixed: str) -> None:
        """Send the robot there, to face in its direction of travel."""
        if topic not in self.goals:
            raise UsageError("this topic does not accept goals")
        start = self.scene.robot_xyz
        ahead = np.zeros(3) if start is None else place - start
        half = np.arctan2(ahead[1], ahead[0]) / 2
        quat_xyzw = np.array([0, 0, np.sin(half), np.cos(half)])
        header = Header(self.scene.time.newest_ns, fixed)
        self._runtime.publish(topic, PoseStamped(place, quat_xyzw, header))

    def _follow(self) -> None:
        self._graph = self._runtime.graph
        self.drawing.follow(self._graph)
        self.controls.follow(topics_of(self._graph))

    def _refresh(self) -> None:
        if self._runtime.graph is not self._graph:
            self._follow()
        self.controls.refresh()
        if self._is_watched():
            self._tell(self.state)

    @property
    def state(self) -> Mapping[str, Any]:
        """State that browsers show beside the nodes."""
        scene = self.scene
        frames = scene.frames
        has_transforms, kinds = bool(frames.tree.frames()), topics_of(self._graph)
        lines = notes(frames.fixed, scene.topic_frames, scene.problems, has_transforms)
        if self._tree.refused:
            lines.append(f"{self._tree.refused} changes rejected: the 3D view is full")
        return {
            "has": scene.view.shown,
            "fixed": frames.fixed,
            "controls": [_described(one) for one in self.controls],
            "changed": self.controls.arrangement,
            "goals": self.goals,
            "notes": lines,
            "missing": [
                f"{topic}: {why}"
                for topic, why in scene.problems.items()
                if kinds.get(topic) not in (*CAMERAS, Imu)  # there is little to see of these
            ],
        }

    def _unthrottled(self) -> bool:
        playback = self._runtime.playback
        return playback is not None and playback.state.rate == 0


def _described(control: Any) -> Mapping[str, Any]:
    names = ("group", "place", "label", "value", "options", "range", "hint", "color")
    return {name: getattr(control, name) for name in names}
