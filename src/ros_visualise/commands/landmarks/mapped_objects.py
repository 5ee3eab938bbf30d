"""Objects found by the network in a smoothed map: localized once more, from its views."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import (
    Detection3D,
    Detections,
    Floats,
    Header,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry import rotations
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.landmarks.localization.estimate import known
from ros_visualise.landmarks.localization.track import Branch, LandmarkTrack
from ros_visualise.landmarks.mapping.mapping import TagMap
from ros_visualise.landmarks.mapping.mapping_data import MappingData, is_tag
from ros_visualise.nodes.landmark_localizer import LandmarkLocalizer, LocalizerParams

_LEFT_DEG, _LEFT_M, _LEFT_S = 0.3, 0.03, 5.0
"""Errors that remain in the views of a smoothed map, and their time constant."""


def objects_again(
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
        fixed_frame=frame_id,
        map="",
    )
    localizer = LandmarkLocalizer(params)
    frames, answer, last_ns = FrameTree(), None, 0
    for message in _objects(gathered):
        poses = _poses(made, gathered, frame_id, message, params.ground_frame)
        if poses:
            frames.add(Transforms(poses), static=False)
            answer = localizer.step(params, objects=message, frames=frames)
            last_ns = message.header.stamp_ns
    seen = localizer.report()["seen"]
    found = answer["landmarks"].detections if answer else ()
    is_new = [one for one in found if one.class_id not in gathered.tag_names]
    return [_track(one, last_ns, seen.get(one.id, 1)) for one in is_new]


def _objects(gathered: MappingData) -> Iterator[Detections]:
    """Detections of objects that are not tags, in order of time."""
    for message in sorted(gathered.messages, key=lambda one: one.header.stamp_ns):
        rest = tuple(one for one in message.detections if not is_tag(one))
        if rest:
            yield replace(message, detections=rest)


def _poses(
    made: TagMap, gathered: MappingData, frame_id: str, message: Detections, ground: str
) -> tuple[TransformStamped, ...]:
    """Poses of the camera, and of the ground's frame if it is another; empty if unknown."""
    header = message.header
    T = gathered.place(frame_id, message)
    if T is None:
        return ()
    found = [_stamped(header.frame_id, made.correction(header.stamp_ns) @ T, header, frame_id)]
    if ground and ground != frame_id:
        try:
            T = gathered.frames.lookup(frame_id, ground, header.stamp_ns)
        except NoTransform:
            return ()
        found.append(_stamped(ground, T, header, frame_id))
    return tuple(found)


def _stamped(child: str, T: Floats, header: Header, frame_id: str) -> TransformStamped:
    quat_xyzw = rotations.from_matrix(T[:3, :3])
    return TransformStamped(child, T[:3, 3], quat_xyzw, Header(header.stamp_ns, frame_id))


def _track(one: Detection3D, last_ns: int, seen: int) -> LandmarkTrack:
    best = one.hypotheses[0]
    here = known(best.position_xyz, rotations.to_matrix(best.quat_xyzw), np.array(best.covariance))
    return LandmarkTrack(
        one.class_id,
        best.number,
        one.id == one.class_id,
        (Branch(here, 0.0),),
        last_ns,
        size_xyz=one.size_xyz,
        sizes=int(one.size_xyz.any()),
        seen=seen,
    )
