"""The end of ``landmarks SRC --map OUT``: a map from the whole recording at once."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ros_visualise.commands.mapping_report import report_lines, report_values
from ros_visualise.data import (
    Detection,
    Detection3D,
    Detections,
    Detections3D,
    Floats,
    Imu,
    Transforms,
)
from ros_visualise.data.frames import is_static
from ros_visualise.errors import DamagedMessage
from ros_visualise.geometry import rotations
from ros_visualise.graph import Graph
from ros_visualise.landmark_pipelines import DETECTORS, RECORDED_TAGS, TAGS
from ros_visualise.landmarks.localization.estimate import known
from ros_visualise.landmarks.localization.track import Branch, Track
from ros_visualise.landmarks.mapping.gathering import Gathered
from ros_visualise.landmarks.mapping.mapping import Map, map_of
from ros_visualise.landmarks.mapping.survey import Survey, read_survey
from ros_visualise.landmarks.tags.known import KnownTags, read_known_tags
from ros_visualise.messages.recorded import content
from ros_visualise.printing import say
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


class Mapper:
    """Listens to a graph, and makes the map when it has ended.

    Args:
        graph: its detectors, and the frames that its source gives.
        args: ``map`` and ``survey`` of the command.
    """

    def __init__(self, graph: Graph, args: Namespace) -> None:
        self._survey = read_survey(args.survey) if args.survey else Survey()
        self._gathered = Gathered()
        self._sizes = _sizes(graph)
        self._unseen: list[str] = []
        self.map: Map | None = None
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

    def finish(self, told: Detections3D | None, is_over: Callable[[], bool]) -> None:
        """Make the `map`; it stays None where no tag of a known size is seen with others.

        Args:
            told: what the localizer has; its frame is that of the map.
            is_over: whether somebody asked for the end.
        """
        frame_id = told.header.frame_id if told else ""
        problem = self._gathered.problem(self._sizes, frame_id)
        problem, self._unseen = self._survey.added_to(problem)
        try:
            self.map = map_of(problem, self._gathered.gyro, is_over) if problem.sightings else None
        except np.linalg.LinAlgError:
            say("ros-visualise: the map is not smoothed: too little was seen to tell all poses")

    def landmarks(self, told: Detections3D | None, last_ns: Mapping[str, int]) -> list[Track]:
        """The tags of the map; and what else was found, moved as the views then were.

        Args:
            told: what the localizer has.
            last_ns: when each class was seen last.
        """
        assert self.map is not None
        tags = list(self.map.tracks)
        of_tags = self._gathered.tag_names
        others = [one for one in (told.detections if told else ()) if one.class_id not in of_tags]
        for one in others:
            T = self.map.correction(last_ns.get(one.class_id, 0))
            tags.append(_moved(one, T, len(tags) + 1, last_ns.get(one.class_id, 0)))
        return tags

    def lines(self) -> list[str]:
        """What the smoothing found, for a person."""
        return [] if self.map is None else report_lines(self.map, self._left_out())

    def values(self) -> dict[str, Any]:
        """The same, for a program."""
        return {} if self.map is None else report_values(self.map, self._left_out())

    def _left_out(self) -> dict[str, int]:
        counted = dict(self._gathered.left_out)
        if self._unseen:
            counted["surveyed tags that were never seen"] = len(self._unseen)
        return counted

    def _frames(self, topic: str) -> Callable[[Transforms], None]:
        static = is_static(topic)
        return lambda message: self._gathered.add_frames(message, static)


def _moved(one: Detection3D, T: Floats, number: int, last_ns: int) -> Track:
    """A landmark of the localizer, elsewhere by T (4, 4)."""
    best = one.hypotheses[0]
    R = T[:3, :3]
    turned = np.kron(np.eye(2), R)
    here = known(
        R @ best.position_xyz + T[:3, 3],
        R @ rotations.to_matrix(best.quat_xyzw),
        turned @ best.covariance @ turned.T,
    )
    return Track(
        one.class_id,
        best.number,
        one.id == one.class_id,
        (Branch(here, 0.0),),
        last_ns,
        number=number,
        size_xyz=one.size_xyz,
        sizes=int(one.size_xyz.any()),
    )


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
