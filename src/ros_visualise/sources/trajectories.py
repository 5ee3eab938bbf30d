"""The way that something went, out of a recording: poses of any type, fixes, paths, or tf."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ros_visualise.data import (
    Floats,
    Header,
    NavSatFix,
    Odometry,
    Path,
    PoseStamped,
    PoseWithCovarianceStamped,
    Transforms,
    TransformStamped,
)
from ros_visualise.errors import DamagedMessage, NoTransform, RosVisualiseError, UsageError
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.located import PLANE_FRAME, Locator
from ros_visualise.geometry.pair import FramePair
from ros_visualise.messages.recorded import content
from ros_visualise.sources.recordings import Recording

_KINDS = (
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
    TransformStamped,
    Path,
    NavSatFix,
    Transforms,
)
"""What a way can be read from, what is taken rather first."""

_HISTORY_S = 60.0
"""How far apart the transforms of one chain may be recorded."""


@dataclass
class Trajectory:
    """The way on one topic.

    Attributes:
        topic: its name; of tf, with its frames.
        path: the poses in order of their stamps, in the frame of its header.
        left_out: why poses were left out -> how many.
        unordered: poses that were recorded before others of earlier stamps.
        without_attitude: poses whose quaternion was zero; they have that of the frame.
    """

    topic: str
    path: Path
    left_out: dict[str, int] = field(default_factory=dict)
    unordered: int = 0
    without_attitude: int = 0


class _Pose(NamedTuple):
    """Its stamp, when it was recorded, position and quaternion (7,), and the frame of these."""

    stamp_ns: int
    recorded_ns: int
    pose: Floats
    frame_id: str


def read_trajectory(recording: Recording, topic: str | None = None) -> Trajectory:
    """Read the way on a topic.

    Stamps are those of the headers or, where no header has one, when the messages were recorded.

    Args:
        recording: what to read.
        topic: its name, or of a pair of frames ``/tf:PARENT.CHILD``, as the package evo writes it,
            with the topic of static transforms after another colon where it is not
            ``/tf_static``. None: the only one of the best type.

    Raises:
        UsageError: there is no such topic, or none is to be preferred; all are listed.
        RosVisualiseError: there are no poses on it.
    """
    reader = _Reader(recording)
    if topic is not None and ":" in topic:
        poses = reader.transforms(topic)
    else:
        topic = _find(recording, topic) if topic is not None else _choose(recording)
        kind = recording.topics[topic].type.data_class
        if kind is Transforms:
            raise UsageError(_ask_for_frames(recording, topic))
        poses = reader.last_path(topic) if kind is Path else reader.poses(topic)
    return _ordered(topic, list(poses), reader)


class _Reader:
    """Reads poses off a recording, and counts what says none."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._locator = Locator()
        self._pair_refused = 0
        self._damaged = 0

    @property
    def left_out(self) -> dict[str, int]:
        """Why -> how many."""
        counts = {
            "without a fix": self._locator.without_fix,
            "no numbers": self._locator.refused + self._pair_refused,
            "damaged": self._damaged,
        }
        return {why: count for why, count in counts.items() if count}

    def poses(self, topic: str) -> Iterator[_Pose]:
        """Of messages that hold one each."""
        for recorded_ns, message in self._messages(topic):
            pose = self._locator.locate(message)
            if pose is not None:
                is_fix = isinstance(message, NavSatFix)
                frame_id = PLANE_FRAME if is_fix else message.header.frame_id
                yield _Pose(message.header.stamp_ns, recorded_ns, pose, frame_id)

    def last_path(self, topic: str) -> Iterator[_Pose]:
        """Of the last path."""
        paths = deque(self._messages(topic), maxlen=1)
        if not paths:
            return
        _, last = paths[0]
        rows = zip(last.stamps_ns.tolist(), last.positions_xyz, last.quats_xyzw, strict=True)
        for stamp_ns, position, quat in rows:
            one = PoseStamped(position, quat, Header(stamp_ns, last.header.frame_id))
            pose = self._locator.locate(one)
            if pose is not None:
                yield _Pose(stamp_ns, stamp_ns, pose, last.header.frame_id)

    def transforms(self, name: str) -> Iterator[_Pose]:
        """Of one frame in another, at the stamps of all transforms between them that move."""
        moving, parent, child, static = self._parse(name)
        tree = FrameTree(_HISTORY_S)
        pair = FramePair(tree, parent, child)
        if static is not None:  # all of them first: they hold at all times
            for _, message in self._messages(static):
                pair.add(message, static=True)
        for _, message in self._messages(moving):
            for stamp_ns, pose in pair.add(message):
                yield _Pose(stamp_ns, stamp_ns, pose, parent)
        self._pair_refused = pair.refused
        try:
            newest_ns = tree.newest_ns(parent, child)
        except NoTransform as error:
            raise UsageError(f"{self._recording.path}: {error}; choose of these") from None
        if newest_ns is None:
            raise UsageError(f"{self._recording.path}: {child} does not move in {parent}")

    def _parse(self, name: str) -> tuple[str, str, str, str | None]:
        topic, _, rest = name.partition(":")
        frames, _, static = rest.partition(":")
        parent, _, child = frames.partition(".")
        if not (parent and child):
            raise UsageError(f"{name}: write a pair of frames as /tf:PARENT.CHILD")
        moving = _find(self._recording, topic, (Transforms,))
        there = {name.lstrip("/"): name for name in self._recording.topics}
        if static:
            return moving, parent, child, _find(self._recording, static, (Transforms,))
        return moving, parent, child, there.get("tf_static")

    def _messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        with closing(self._recording.read(topics=[topic])) as entries:
            for entry in entries:
                try:
                    yield entry.stamp_ns, content(entry.message)
                except DamagedMessage:
                    self._damaged += 1


def _find(recording: Recording, wanted: str, kinds: tuple[type, ...] = _KINDS) -> str:
    """The topic of that name, with or without its first slash."""
    there = _candidates(recording, kinds)
    found = [name for name in there if name.lstrip("/") == wanted.lstrip("/")]
    if not found:
        listed = ", ".join(there) or "none that a way can be read from"
        raise UsageError(f"{recording.path}: no poses on {wanted}; there is {listed}")
    return found[0]


def _choose(recording: Recording) -> str:
    there = _candidates(recording)
    for kind in _KINDS:
        of_kind = _candidates(recording, (kind,))
        if len(of_kind) == 1 or (of_kind and kind is Transforms):
            return of_kind[0]
        if of_kind:
            listed = ", ".join(there)
            raise UsageError(f"{recording.path}: several have poses; choose --topic of {listed}")
    raise UsageError(f"{recording.path}: no topic of poses in it; see ros-visualise info")


def _candidates(recording: Recording, kinds: tuple[type, ...] = _KINDS) -> list[str]:
    topics = recording.topics.items()
    return [name for name, info in topics if info.type.data_class in kinds and info.messages]


def _ask_for_frames(recording: Recording, topic: str) -> str:
    tree = FrameTree(_HISTORY_S)
    for entry in recording.read(topics=_candidates(recording, (Transforms,))):
        try:
            tree.add(content(entry.message))
        except (DamagedMessage, ValueError):
            continue
    frames = ", ".join(tree.frames())
    return f"{recording.path}: choose two frames by --topic {topic}:PARENT.CHILD of {frames}"


def _ordered(topic: str, poses: list[_Pose], reader: _Reader) -> Trajectory:
    if not poses:
        why = ", ".join(f"{count} {why}" for why, count in reader.left_out.items())
        raise RosVisualiseError(f"no poses on {topic}{': ' if why else ''}{why}")
    stamps_ns = np.array([one.stamp_ns for one in poses], np.int64)
    if not stamps_ns.any():
        stamps_ns = np.array([one.recorded_ns for one in poses], np.int64)
    rows = np.array([one.pose for one in poses])
    unordered = int((stamps_ns < np.maximum.accumulate(stamps_ns)).sum())
    order = np.argsort(stamps_ns, kind="stable")
    stamps_ns, rows = stamps_ns[order], rows[order]
    flat = ~rows[:, 3:].any(axis=1)
    rows[flat, 6] = 1
    header = Header(int(stamps_ns[-1]), poses[0].frame_id)
    path = Path(stamps_ns, rows[:, :3], rows[:, 3:], header)
    return Trajectory(topic, path, reader.left_out, unordered, int(flat.sum()))
