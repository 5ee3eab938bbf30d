"""The calibrations of a running graph's images, recorded beside them as ROS does it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import CameraInfo, Image
from ros_visualise.graph import Graph
from ros_visualise.messages.calibrations import (
    CAMERA_INFO,
    calibration_of,
    calibration_topic,
    info_topic,
)
from ros_visualise.sinks import Recorder


def calibration_topics(graph: Graph) -> dict[str, str]:
    """Topic of images -> topic of their calibration, of the graph or only of the recording.

    A source publishes it itself; for others it is where ROS expects it, unless that topic has
    another type.
    """
    types = {name: topic.ros for name, topic in graph.topics.items()}
    found = {}
    for name, topic in graph.topics.items():
        if topic.type is Image:
            is_source = graph.source is not None and topic.publisher == graph.source.name
            given = calibration_topic(name, types) if is_source else None
            place = given or info_topic(name.removesuffix("/compressed"))
            if types.get(place, CAMERA_INFO).name == CAMERA_INFO.name:
                found[name] = place
    return found


class Calibrations:
    """Makes the calibration messages that the graph itself does not publish.

    Their topic is added to the recording with the first calibration. A later image without one is
    recorded as of an uncalibrated camera.

    Args:
        graph: what runs.
        recorder: records its images.
    """

    def __init__(self, graph: Graph, recorder: Recorder) -> None:
        self._recorder = recorder
        self._topics: dict[str, str] = {}
        for images, topic in calibration_topics(graph).items():
            is_free = topic not in graph.topics and topic not in self._topics.values()
            if images in recorder.topics and is_free:
                self._topics[images] = topic

    def find(self, topic: str, image: Any) -> tuple[str, CameraInfo] | None:
        """The calibration to record before a message, and its topic.

        Raises:
            DamagedMessage: the calibration is invalid.
        """
        place = self._topics.get(topic)
        if place is None:
            return None
        try:
            info = calibration_of(image)
        except Exception as error:  # whatever a foreign class raises
            raise DamagedMessage(f"not a calibration: {error}") from error
        if info is None and isinstance(image, Image) and place in self._recorder.topics:
            info = replace(CameraInfo.uncalibrated(image.height, image.width), header=image.header)
        if info is None:
            return None
        if place not in self._recorder.topics:
            self._recorder.add(place, CAMERA_INFO)
        return (place, info) if place in self._recorder.topics else None
