"""The thread that draws the newest message of each topic, while a browser is connected."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Container, Mapping
from typing import Any

from ros_visualise.data import CameraInfo, Image, PointCloud, Text, Transforms
from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.topics import Subscription
from ros_visualise.ui.periodic import PeriodicThread
from ros_visualise.ui.scene.kinds import HELD, is_spatial
from ros_visualise.ui.scene.scene import Scene
from ros_visualise.ui.shown import is_robot

_PERIOD_S = 1 / 15
_IMAGE_PERIOD_S = 1 / 5
_MOST_HELD = 1000  # that wait at most: none must be lost in between


def topics_of(graph: Graph) -> dict[str, type]:
    """The topics of a graph for the scene: none if it has images alone, and none made on demand."""
    kinds = {name: topic.type for name, topic in graph.topics.items() if not topic.on_demand}
    kinds |= graph.inputs
    kinds = {name: kind for name, kind in kinds.items() if kind is not Text or is_robot(name)}
    return kinds if any(is_spatial(kind) for kind in kinds.values()) else {}


class SceneThread(PeriodicThread):
    """Has a scene draw the messages of a runtime, up to 15 times a second.

    Transforms and markers are taken at all times, so that browsers that come later see them too;
    everything else only while ``is_watched``.

    Args:
        unthrottled: True while the graph runs as fast as possible, and work here slows it.
    """

    def __init__(
        self,
        runtime: Runtime,
        scene: Scene,
        is_watched: Callable[[], bool],
        unthrottled: Callable[[], bool],
    ) -> None:
        super().__init__("scene", self._do_round, self._finish, _PERIOD_S, unthrottled)
        self._runtime, self._scene = runtime, scene
        scene.time.is_live = runtime.playback is None
        self._is_watched = is_watched
        self._taking = threading.Lock()
        self._frames: dict[str, Subscription] = {}
        self._held: dict[str, Subscription] = {}
        self._messages: dict[str, Subscription] = {}
        self._taken_s: dict[str, float] = {}
        self._kinds: Mapping[str, type] = {}
        self._place = 0

    def follow(self, graph: Graph) -> None:
        with self.at_work:
            self._kinds = topics_of(graph)
            self._scene.follow(self._kinds)
            self._subscribe(self._held, HELD)
            with self._taking:
                has_overlays = {Image, PointCloud} <= {*self._kinds.values()}
                of_cameras = (CameraInfo,) if has_overlays else ()
                self._subscribe(self._frames, (Transforms, *of_cameras))
            self._rest_but(self._kinds)

    def take_frames(self) -> None:
        """Take the transforms and calibrations that have come; from any thread."""
        with self._taking:
            for topic, subscription in self._frames.items():
                while (message := subscription.take(0)) is not None:
                    self._note_place(subscription.epoch)
                    self._scene.add_frames(topic, message)

    def _subscribe(self, held: dict[str, Subscription], kinds: Collection[type]) -> None:
        wanted = {topic for topic, kind in self._kinds.items() if kind in kinds}
        for topic in held.keys() - wanted:
            held.pop(topic).close()
        for topic in wanted - held.keys():
            held[topic] = self._runtime.subscribe(topic, _MOST_HELD)

    def _finish(self) -> None:
        self._rest_but(())
        with self._taking:
            for subscription in (*self._held.values(), *self._frames.values()):
                subscription.close()
            self._frames = {}

    def _do_round(self) -> None:
        self.take_frames()
        for topic, subscription in self._held.items():
            while (message := subscription.take(0)) is not None:
                self._show(topic, message, subscription.epoch)
        if not self._is_watched():
            self._rest_but(())
            return
        for topic, kind in self._kinds.items():
            if kind not in (*HELD, Transforms):
                self._take(topic, kind)
        self._scene.refresh()

    def _take(self, topic: str, kind: type) -> None:
        now_s = time.monotonic()
        if not self._scene.wants(topic):
            self._rest(topic)
            return
        if self._scene.is_waiting(topic):
            return  # what comes meanwhile waits in its queue
        if kind is Image and now_s - self._taken_s.get(topic, 0.0) < _IMAGE_PERIOD_S:
            return
        if topic not in self._messages:
            self._messages[topic] = self._runtime.subscribe(topic)
        message = self._messages[topic].take(0)
        if message is not None:
            self._taken_s[topic] = now_s
            self._show(topic, message, self._messages[topic].epoch)

    def _show(self, topic: str, message: Any, epoch: int) -> None:
        with self._taking:
            self._note_place(epoch)
        self._scene.show(topic, message)

    def _note_place(self, epoch: int) -> None:
        """After a time jump, clear the scene."""
        if epoch > self._place:
            self._place = epoch
            self._scene.forget()

    def _rest(self, topic: str) -> None:
        """Unsubscribe until the topic is wanted again."""
        if topic in self._messages:
            self._messages.pop(topic).close()

    def _rest_but(self, kept: Container[str]) -> None:
        for topic in [topic for topic in self._messages if topic not in kept]:
            self._rest(topic)
