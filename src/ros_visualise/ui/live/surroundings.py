"""The frames and calibrations of a running graph's cameras."""

from __future__ import annotations

import threading

from ros_visualise.data import CameraInfo, Image, PointCloud, Transforms
from ros_visualise.data.poses import is_static
from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.topics import Subscription
from ros_visualise.ui.scene.frames import Frames

_MOST_WAITING = 1000


class Surroundings:
    """The newest transforms and calibrations, by topics that are taken at all times.

    Nothing is taken where there are no clouds to draw over images.

    Attributes:
        frames: the frames.
        calibrations: frame -> calibration of its camera.
    """

    def __init__(self, runtime: Runtime) -> None:
        self.frames = Frames()
        self.calibrations: dict[str, CameraInfo] = {}
        self._runtime = runtime
        self._subscriptions: dict[str, Subscription] = {}
        self._place = (0, 0)
        self._taking = threading.Lock()
        self.follow(runtime.graph)

    def follow(self, graph: Graph) -> None:
        """Take the topics of this graph."""
        kinds = {name: topic.type for name, topic in graph.topics.items()}
        is_needed = {Image, PointCloud} <= set(kinds.values())
        taken = (Transforms, CameraInfo) if is_needed else ()
        wanted = {name for name, kind in kinds.items() if kind in taken}
        with self._taking:
            for topic in self._subscriptions.keys() - wanted:
                self._subscriptions.pop(topic).close()
            for topic in wanted - self._subscriptions.keys():
                self._subscriptions[topic] = self._runtime.subscribe(topic, _MOST_WAITING)

    def refresh(self) -> None:
        """Take what has come; from any thread."""
        with self._taking:
            for topic, subscription in self._subscriptions.items():
                while (message := subscription.take(0)) is not None:
                    self._note_place(subscription.epoch)
                    if isinstance(message, Transforms):
                        self.frames.add(message, is_static(topic))
                    else:
                        self.calibrations[message.header.frame_id] = message

    def close(self) -> None:
        """Unsubscribe."""
        with self._taking:
            for subscription in self._subscriptions.values():
                subscription.close()
            self._subscriptions = {}

    def _note_place(self, epoch: int) -> None:
        """Forget the moving frames after a time jump or at a new lap."""
        playback = self._runtime.playback
        place = epoch, 0 if playback is None else playback.laps
        if place > self._place:
            self._place = place
            self.frames.forget()
