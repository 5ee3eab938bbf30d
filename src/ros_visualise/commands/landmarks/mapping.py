"""The end of ``landmarks SRC --map OUT``: a map from the whole recording at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ros_visualise.commands.landmarks.mapped_objects import objects_again
from ros_visualise.commands.landmarks.mapping_report import report_lines, report_values
from ros_visualise.core.errors import DamagedMessage
from ros_visualise.core.printing import say
from ros_visualise.data import (
    Detection,
    Detections,
    Detections3D,
    Imu,
    Transforms,
)
from ros_visualise.data.frames import is_static
from ros_visualise.graph import Graph
from ros_visualise.graph.landmarks import DETECTORS, LOCALIZER, RECORDED_TAGS, TAGS
from ros_visualise.landmarks.localization.track import LandmarkTrack
from ros_visualise.landmarks.mapping.mapping import TagMap, map_of
from ros_visualise.landmarks.mapping.mapping_data import MappingData
from ros_visualise.landmarks.mapping.survey import Survey, read_survey
from ros_visualise.landmarks.tags.known import KnownTags, read_known_tags
from ros_visualise.messages.recorded import content
from ros_visualise.nodes.landmark_localizer import LocalizerParams
from ros_visualise.runtime.queues import Packet


class Listener:
    """Hands the messages of a topic on; what is damaged is told of by the nodes that need it."""

    def __init__(self, take: Callable[[Any], None]) -> None:
        self._take = take

    def put(self, packet: Packet) -> None:
        """Take a packet."""
        if packet.message is None:
            return
        try:
            self._take(content(packet.message))
        except DamagedMessage:
            return

    def close(self) -> None:
        """Nothing more comes."""


@dataclass(frozen=True, eq=False)
class Mapped:
    """The tags, smoothed; these and all else as they are in the map; what was left out, and why."""

    map: TagMap
    landmarks: Sequence[LandmarkTrack]
    left_out: Mapping[str, int]

    def lines(self) -> list[str]:
        """What the smoothing found, for a person."""
        return report_lines(self.map, self.left_out)

    def values(self) -> dict[str, Any]:
        """The same, for a program."""
        return report_values(self.map, self.left_out)


class Mapper:
    """Listens to a graph, and makes the map when it has ended.

    Args:
        graph: its detectors, and the frames that its source gives.
        survey: file with measured places of tags, or distances; empty: none.
    """

    def __init__(self, graph: Graph, survey: str) -> None:
        self._survey = read_survey(survey) if survey else Survey()
        self._gathered = MappingData()
        self._sizes = _sizes(graph)
        self._localizer = next(
            (node.params for node in graph.nodes if node.name == LOCALIZER), LocalizerParams()
        )
        nodes = {node.name: node for node in graph.nodes if node.name in DETECTORS}
        found = [
            topic
            for node in nodes.values()
            for topic, made in node.topics.items()
            if made.type is Detections
        ]
        assert graph.source is not None
        given = graph.source.topics.items()
        frames = [name for name, made in given if made.type is Transforms]
        imus = [name for name, made in given if made.type is Imu][:1]
        self.listeners: Mapping[str, Listener] = {
            **{topic: Listener(self._gathered.add_found) for topic in found},
            **{topic: Listener(self._frames(topic)) for topic in frames},
            **{topic: Listener(self._gathered.add_imu) for topic in imus},
        }

    def finish(self, told: Detections3D | None) -> Mapped | None:
        """Make the map; None where no tag of a known size is seen with others.

        Args:
            told: what the localizer has; its frame is that of the map.
        """
        frame_id = told.header.frame_id if told else ""
        problem = self._gathered.problem(self._sizes, frame_id)
        problem, unseen = self._survey.added_to(problem)
        try:
            made = map_of(problem, self._gathered.gyro) if problem.sightings else None
        except np.linalg.LinAlgError:
            say("ros-visualise: the map is not smoothed: too little was seen to tell all poses")
            return None
        if made is None:
            return None
        others = objects_again(made, self._gathered, frame_id, self._localizer)
        landmarks = [*made.tracks, *others]
        for number, one in enumerate(landmarks, 1):
            one.number = number
        left_out = dict(self._gathered.skipped)
        if unseen:
            left_out["surveyed tags that were never seen"] = len(unseen)
        return Mapped(made, landmarks, left_out)

    def _frames(self, topic: str) -> Callable[[Transforms], None]:
        static = is_static(topic)
        return lambda message: self._gathered.add_frames(message, static)


def _sizes(graph: Graph) -> Callable[[Detection], float]:
    """The sides of tags, as the detectors know them."""
    for node in graph.nodes:
        if node.name in (TAGS, RECORDED_TAGS):
            params: Any = node.params
            known = read_known_tags(params.tags) if params.tags else KnownTags()
            return lambda one: (
                known.sizes.get(int(one.id), params.size) if one.id.isdecimal() else 0.0
            )
    return lambda _: 0.0
