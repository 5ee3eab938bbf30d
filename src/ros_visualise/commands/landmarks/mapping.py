"""The map of ``landmarks SRC --map OUT``, from the whole recording at once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ros_visualise.commands.landmarks.sightings import MessageListener
from ros_visualise.core.errors import NoTransform
from ros_visualise.core.printing import print_status
from ros_visualise.data import (
    Detection,
    Detections,
    Detections3D,
    Imu,
    Transforms,
)
from ros_visualise.data.poses import is_static
from ros_visualise.estimation.camera_view import PLACE
from ros_visualise.estimation.localization.localizer import Localizer
from ros_visualise.estimation.localization.track import LandmarkTrack
from ros_visualise.estimation.mapping.mapped_places import places_in
from ros_visualise.estimation.mapping.mapping import TagMap, map_of
from ros_visualise.estimation.mapping.mapping_data import MappingData, is_tag
from ros_visualise.estimation.mapping.problem import RigCamera
from ros_visualise.estimation.mapping.survey import Survey, read_survey
from ros_visualise.graph import Graph
from ros_visualise.graph.landmarks import LOCALIZER, PLACES, RECORDED_TAGS, TAGS, detectors_of
from ros_visualise.landmarks.tags.known import KnownTags, read_known_tags
from ros_visualise.nodes.landmark_localizer import LocalizerParams, rules_of
from ros_visualise.sources.calibration import find_uncertainty

_LEFT_DEG, _LEFT_M, _LEFT_S = 0.3, 0.03, 5.0
"""Errors that remain in the views of a smoothed map, and their time constant."""


@dataclass(frozen=True, eq=False)
class MappedLandmarks:
    """The smoothed map of tags; all landmarks in it; its frame; unused data by reason."""

    map: TagMap
    landmarks: Sequence[LandmarkTrack]
    frame_id: str
    unused: Mapping[str, int]

    @property
    def has_places(self) -> bool:
        """True if some landmarks are places."""
        return any(one.class_id.startswith(PLACE) for one in self.landmarks)

    def with_places(self, kept: Collection[str]) -> MappedLandmarks:
        """The same without other places than these."""
        landmarks = [
            one
            for one in self.landmarks
            if one.class_id in kept or not one.class_id.startswith(PLACE)
        ]
        return replace(self, landmarks=landmarks)


class LandmarkMapper:
    """Gathers the messages of a graph, and makes the map when it has ended.

    Args:
        graph: its detectors, and the frames of its source.
        survey: file with measured positions of tags, or distances; empty: none.
        calibrations: files of the calibrations of all cameras, or of each.
    """

    def __init__(self, graph: Graph, survey: str, calibrations: Sequence[str] = ()) -> None:
        self._survey = read_survey(survey) if survey else Survey()
        detectors = detectors_of(graph)
        cameras = list(dict.fromkeys(topic for one in detectors for topic in one.inputs.values()))
        known = [find_uncertainty(url) for url in calibrations]
        known = known if len(known) == len(cameras) else (known or [None]) * len(cameras)
        self._gathered = MappingData(
            [
                RigCamera(name, calibration=one, is_exact=_is_ideal(graph))
                for name, one in zip(cameras, known, strict=True)
            ]
        )
        self._sizes = _sizes(graph)
        self._localizer = next(
            (node.params for node in graph.nodes if node.name == LOCALIZER), LocalizerParams()
        )
        assert graph.source is not None
        frames = graph.source.topics_of(Transforms)
        imus = graph.source.topics_of(Imu)[:1]
        takers: dict[str, Callable[[Any], None]] = {
            **{
                topic: partial(self._gathered.add_found, camera=cameras.index(taken))
                for node in detectors
                for topic in node.topics_of(Detections)
                for taken in node.inputs.values()
            },
            **{topic: self._frames(topic) for topic in frames},
            **dict.fromkeys(imus, self._gathered.add_imu),
            **dict.fromkeys(_places_of(graph), self._gathered.add_places),
        }
        self.listeners = {
            topic: MessageListener(_unnumbered(take)) for topic, take in takers.items()
        }

    def finish(self, localized: Detections3D | None) -> MappedLandmarks | None:
        """Make the map; None if no tag of a known size is seen with others.

        Args:
            localized: the landmarks of the localizer, in ``odom`` if no frame ``map`` is known.
        """
        frame_id = localized.header.frame_id if localized else ""
        problem = self._gathered.problem(self._sizes, frame_id)
        problem, unseen = self._survey.added_to(problem)
        try:
            made = map_of(problem, self._gathered.gyro) if problem.sightings else None
        except np.linalg.LinAlgError:
            print_status("ros-visualise: map not smoothed: too few sightings to estimate all poses")
            return None
        if made is None:
            return None
        others = _objects_again(made, self._gathered, frame_id, self._localizer)
        landmarks = [*made.tracks, *others, *places_in(made.smoothed, self._gathered.places)]
        for number, one in enumerate(landmarks, 1):
            one.number = number
        unused = dict(self._gathered.skipped)
        if unseen:
            unused["surveyed tags that were never seen"] = len(unseen)
        return MappedLandmarks(made, landmarks, self._localizer.fixed_frame, unused)

    def _frames(self, topic: str) -> Callable[[Transforms], None]:
        static = is_static(topic)
        return lambda message: self._gathered.add_frames(message, static)


def _places_of(graph: Graph) -> list[str]:
    """The topics of places."""
    return [one.outputs["places"] for one in graph.nodes if one.type.name == PLACES]


def _unnumbered(take: Callable[[Any], None]) -> Callable[[int, Any], None]:
    return lambda _, message: take(message)


def _is_ideal(graph: Graph) -> bool:
    """True if the images are rendered by an ideal camera."""
    return any(getattr(node.params, "corner_floor", 1) == 0 for node in detectors_of(graph))


def _sizes(graph: Graph) -> Callable[[Detection], float]:
    """The sides of tags, by the detectors' parameters."""
    for node in graph.nodes:
        if node.type.name in (TAGS, RECORDED_TAGS):
            params: Any = node.params
            tags = read_known_tags(params.tags) if params.tags else KnownTags()
            return lambda one: (
                tags.sizes.get(int(one.id), params.size) if one.id.isdecimal() else 0.0
            )
    return lambda _: 0.0


def _objects_again(
    made: TagMap, gathered: MappingData, frame_id: str, params: LocalizerParams
) -> list[LandmarkTrack]:
    """The localizer's landmarks that are not tags, with corrected poses of the camera.

    Args:
        made: the map, which corrects the frames.
        gathered: detections and frames.
        frame_id: the map's frame.
        params: the localizer's parameters.
    """
    params = replace(
        params,
        attitude_sigma=min(params.attitude_sigma, _LEFT_DEG),
        position_sigma=min(params.position_sigma, _LEFT_M),
        attitude_time=_LEFT_S,
        position_time=_LEFT_S,
    )
    localizer, prefix = Localizer(), params.object_prefix
    for message in _objects(gathered):
        stamp_ns = message.header.stamp_ns
        T = gathered.place(frame_id, message)
        with suppress(NoTransform):
            rules = rules_of(params, prefix, gathered.frames, frame_id, stamp_ns)
            if T is not None:
                localizer.observe(message, made.correction(stamp_ns) @ T, rules)
    found = localizer.landmarks.values()
    return [one for one in found if one.class_id not in gathered.tag_names]


def _objects(gathered: MappingData) -> Iterator[Detections]:
    """Detections of objects that are not tags, in order of time."""
    for message in sorted(gathered.messages, key=lambda one: one.header.stamp_ns):
        rest = tuple(one for one in message.detections if not is_tag(one))
        if rest:
            yield replace(message, detections=rest)
