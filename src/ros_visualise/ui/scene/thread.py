"""The thread that draws the newest message of each topic, while a browser is connected."""

from __future__ import annotations

import time
from collections.abc import Callable, Container, Mapping
from typing import Any

from ros_visualise.data import Image, Text
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
        self._held: dict[str, Subscription] = {}
        self._messages: dict[str, Subscription] = {}
        self._taken_s: dict[str, float] = {}
        self._kinds: Mapping[str, type] = {}
        self._place = (0, 0)

    def follow(self, graph: Graph) -> None:
        with self.at_work:
            self._kinds = topics_of(graph)
            self._scene.follow(self._kinds)
            wanted = {topic for topic, kind in self._kinds.items() if kind in HELD}
            for topic in self._held.keys() - wanted:
                self._held.pop(topic).close()
            for topic in wanted - self._held.keys():
                self._held[topic] = self._runtime.subscribe(topic, _MOST_HELD)
            self._rest_but(self._kinds)

    def _finish(self) -> None:
        self._rest_but(())
        for subscription in self._held.values():
            subscription.close()

    def _do_round(self) -> None:
        for topic, subscription in self._held.items():
            while (message := subscription.take(0)) is not None:
                self._show(topic, message, subscription.epoch)
        if not self._is_watched():
            self._rest_but(())
            return
        for topic, kind in self._kinds.items():
            if kind not in HELD:
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
        """Draw a message; after a time jump or at a new lap, clear the scene first."""
        playback = self._runtime.playback
        place = epoch, 0 if playback is None else playback.laps
        if place > self._place:
            self._place = place
            self._scene.forget()
        self._scene.show(topic, message)

    def _rest(self, topic: str) -> None:
        """Unsubscribe until the topic is wanted again."""
        if topic in self._messages:
            self._messages.pop(topic).close()

    def _rest_but(self, kept: Container[str]) -> None:
        for topic in [topic for topic in self._messages if topic not in kept]:
            self._rest(topic)
