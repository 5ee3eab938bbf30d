"""The map of ``landmarks SRC --map OUT``, from the whole recording at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ros_visualise.commands.landmarks.mapped_objects import objects_again
from ros_visualise.commands.landmarks.sightings import MessageListener
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
from ros_visualise.nodes.landmark_localizer import LocalizerParams


@dataclass(frozen=True, eq=False)
class MappedLandmarks:
    """The smoothed map of tags; all landmarks in it; numbers of unused data by reason."""

    map: TagMap
    landmarks: Sequence[LandmarkTrack]
    unused: Mapping[str, int]


class LandmarkMapper:
    """Gathers the messages of a graph, and makes the map when it has ended.

    Args:
        graph: its detectors, and the frames of its source.
        survey: file with measured positions of tags, or distances; empty: none.
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
        takers: dict[str, Callable[[Any], None]] = {
            **dict.fromkeys(found, self._gathered.add_found),
            **{topic: self._frames(topic) for topic in frames},
            **dict.fromkeys(imus, self._gathered.add_imu),
        }
        self.listeners = {
            topic: MessageListener(_unnumbered(take)) for topic, take in takers.items()
        }

    def finish(self, localized: Detections3D | None) -> MappedLandmarks | None:
        """Make the map; None if no tag of a known size is seen with others.

        Args:
            localized: the landmarks of the localizer; their frame is that of the map.
        """
        frame_id = localized.header.frame_id if localized else ""
        problem = self._gathered.problem(self._sizes, frame_id)
        problem, unseen = self._survey.added_to(problem)
        try:
            made = map_of(problem, self._gathered.gyro) if problem.sightings else None
        except np.linalg.LinAlgError:
            say("ros-visualise: map not smoothed: too few sightings to estimate all poses")
            return None
        if made is None:
            return None
        others = objects_again(made, self._gathered, frame_id, self._localizer)
        landmarks = [*made.tracks, *others]
        for number, one in enumerate(landmarks, 1):
            one.number = number
        unused = dict(self._gathered.skipped)
        if unseen:
            unused["surveyed tags that were never seen"] = len(unseen)
        return MappedLandmarks(made, landmarks, unused)

    def _frames(self, topic: str) -> Callable[[Transforms], None]:
        static = is_static(topic)
        return lambda message: self._gathered.add_frames(message, static)


def _unnumbered(take: Callable[[Any], None]) -> Callable[[int, Any], None]:
    return lambda _, message: take(message)


def _sizes(graph: Graph) -> Callable[[Detection], float]:
    """The sides of tags, by the detectors' parameters."""
    for node in graph.nodes:
        if node.name in (TAGS, RECORDED_TAGS):
            params: Any = node.params
            known = read_known_tags(params.tags) if params.tags else KnownTags()
            return lambda one: (
                known.sizes.get(int(one.id), params.size) if one.id.isdecimal() else 0.0
            )
    return lambda _: 0.0
