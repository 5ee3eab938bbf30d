"""Trajectories out of a recording: poses of any type, fixes, paths, or one frame in another by tf.

Two frames are named ``/tf:PARENT.CHILD``, as the package evo writes it; the topic of static
transforms, if it is not ``/tf_static``, follows after another colon.
"""

from __future__ import annotations

import logging
from collections import Counter, deque
from collections.abc import Collection, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import DamagedMessage, NoTransform, RosVisualiseError, UsageError
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
from ros_visualise.geometry.frames import FrameTree, WrongTransforms
from ros_visualise.geometry.located import PLANE_FRAME, FramePair, Locator
from ros_visualise.messages.recorded import content
from ros_visualise.sources.recordings import Recording, readable

log = logging.getLogger(__name__)

_HISTORY_S = 60.0  # the transforms of one chain may be recorded that far apart
_KINDS = (
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
    TransformStamped,
    Path,
    NavSatFix,
    Transforms,
)
"""Messages that hold trajectories, the preferred ones first."""


@dataclass
class Trajectory:
    """The trajectory on one topic.

    Attributes:
        topic: its name; of tf, with its frames.
        path: the poses in order of their stamps, in the frame of its header.
        skipped: reason -> number of skipped poses.
        unordered: poses that were recorded before others of earlier stamps.
        repeated: poses that have the stamp of the one before.
        without_attitude: poses whose quaternion was zero; they have that of the frame.
        stamped: true if there are times; else all stamps are zero.
        turns: true if attitudes are known; of fixes they are not.
    """

    topic: str
    path: Path
    skipped: dict[str, int] = field(default_factory=dict)
    unordered: int = 0
    repeated: int = 0
    without_attitude: int = 0
    stamped: bool = True
    turns: bool = True


class NamedPair(NamedTuple):
    """A frame in another, and the topics of moving and of static transforms."""

    topic: str
    parent: str
    child: str
    static: str | None


class _Pose(NamedTuple):
    """Its stamp, when it was recorded, position and quaternion (7,), and the frame of these."""

    stamp_ns: int
    recorded_ns: int
    pose: Floats
    frame_id: str


def read_trajectory(
    recording: Recording, topic: str | None = None, but: str | None = None
) -> Trajectory:
    """Read the trajectory on a topic, or of a pair of frames; None: the only one of the best type.

    Stamps are those of the headers or, if no header has one, when the messages were recorded.
    ``but``: a topic that is not to be chosen. Raises UsageError if the topic is unknown, or none is
    preferred; RosVisualiseError if it has no poses.
    """
    reader = _Reader(recording)
    if topic is not None and ":" in topic:
        poses = reader.transforms(topic)
    else:
        topic = _find_topic(recording, topic, _KINDS) if topic else _choose(recording, but)
        kind = recording.topics[topic].type.data_class
        if kind is Transforms:
            raise UsageError(ask_for_pair(recording, topic))
        poses = reader.last_path(topic) if kind is Path else reader.poses(topic)
    found = list(poses)
    stamps_ns = np.array([one.stamp_ns for one in found], np.int64)
    if not stamps_ns.any():
        stamps_ns = np.array([one.recorded_ns for one in found], np.int64)
    rows = np.array([one.pose for one in found])
    frame_id = found[0].frame_id if found else ""
    trajectory = ordered(topic, stamps_ns, rows, frame_id, reader.skipped)
    trajectory.turns &= reader.has_attitudes
    return trajectory


def has_poses(recording: Recording, topic: str) -> bool:
    """True if a recording has a topic with a trajectory of that name, or such frames."""
    name = topic.partition(":")[0].lstrip("/")
    return any(name == one.lstrip("/") for one in _topics_of(recording, _KINDS))


def ordered(
    topic: str,
    stamps_ns: npt.NDArray[np.int64],
    rows: Floats,
    frame_id: str,
    skipped: dict[str, int],
) -> Trajectory:
    """The trajectory of poses (N, 7) in any order: x, y, z and a quaternion x, y, z, w each.

    Raises:
        RosVisualiseError: no poses.
    """
    if not len(rows):
        why = ", ".join(f"{count} {why}" for why, count in skipped.items())
        raise RosVisualiseError(f"no poses on {topic}{': ' if why else ''}{why}")
    unordered = int((stamps_ns < np.maximum.accumulate(stamps_ns)).sum())
    order = np.argsort(stamps_ns, kind="stable")
    stamps_ns, rows = stamps_ns[order], rows[order]
    flat = ~rows[:, 3:].any(axis=1)
    rows[flat, 6] = 1
    path = Path(stamps_ns, rows[:, :3], rows[:, 3:], Header(int(stamps_ns[-1]), frame_id))
    repeated = int((np.diff(stamps_ns) == 0).sum())
    without_attitude = int(flat.sum())
    turns = without_attitude < len(rows)
    return Trajectory(topic, path, skipped, unordered, repeated, without_attitude, turns=turns)


def parse_pair(recording: Recording, name: str) -> NamedPair:
    """The pair of frames with a name; raises UsageError."""
    topic, _, rest = name.partition(":")
    frames, _, static = rest.partition(":")
    parent, _, child = frames.partition(".")
    if not (parent and child):
        raise UsageError(f"{name}: write a pair of frames as /tf:PARENT.CHILD")
    moving = _find_topic(recording, topic, (Transforms,))
    if static:
        return NamedPair(moving, parent, child, _find_topic(recording, static, (Transforms,)))
    there = {name.lstrip("/"): name for name in recording.topics}
    return NamedPair(moving, parent, child, there.get("tf_static"))


def need_motion(recording: Recording, pair: NamedPair) -> None:
    """Read until the child is seen to move in the parent; raises UsageError if it does not."""
    tree = FrameTree(_HISTORY_S)
    topics = [pair.topic, *([pair.static] if pair.static else [])]
    with closing(readable(recording, topics)) as entries:
        for entry in entries:
            with suppress(ValueError):  # has no frames
                tree.add(entry.message, entry.topic == pair.static)
            with suppress(NoTransform):
                if tree.newest_ns(pair.parent, pair.child) is not None:
                    return
    _check_motion(recording, pair, tree)


def ask_for_pair(recording: Recording, topic: str) -> str:
    """A message on how to follow a frame by tf, with the names of all frames."""
    tree = FrameTree(_HISTORY_S)
    for entry in readable(recording, _topics_of(recording, (Transforms,))):
        with suppress(ValueError):
            tree.add(entry.message, False)
    frames = ", ".join(tree.frames())
    if not frames:
        return f"{recording.path}: contains neither poses nor readable transforms"
    return f"{recording.path}: choose two frames as {topic}:PARENT.CHILD from {frames}"


class _Reader:
    """Reads poses off a recording, and counts messages without one."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._locator = Locator()
        self._wrong_transforms: Counter[str] = Counter()
        self._damaged = 0
        self.has_attitudes = True

    @property
    def skipped(self) -> dict[str, int]:
        """Reason -> number of skipped messages."""
        counts = {
            "without a fix": self._locator.without_fix,
            "not finite": self._locator.refused,
            "damaged": self._damaged,
            **{f"transforms: {what}": n for what, n in self._wrong_transforms.items()},
        }
        return {why: count for why, count in counts.items() if count}

    def poses(self, topic: str) -> Iterator[_Pose]:
        """The poses of messages with one each."""
        for recorded_ns, message in self._messages(topic):
            pose = self._locator.locate(message)
            if pose is not None:
                is_fix = isinstance(message, NavSatFix)
                self.has_attitudes = not is_fix
                frame_id = PLANE_FRAME if is_fix else message.header.frame_id
                yield _Pose(message.header.stamp_ns, recorded_ns, pose, frame_id)

    def last_path(self, topic: str) -> Iterator[_Pose]:
        """The poses of the last path."""
        for _, last in deque(self._messages(topic), maxlen=1):
            frame_id = last.header.frame_id
            rows = zip(last.stamps_ns.tolist(), last.positions_xyz, last.quats_xyzw, strict=True)
            for stamp_ns, position, quat in rows:
                one = PoseStamped(position, quat, Header(stamp_ns, frame_id))
                pose = self._locator.locate(one)
                if pose is not None:
                    yield _Pose(stamp_ns, stamp_ns, pose, frame_id)

    def transforms(self, name: str) -> Iterator[_Pose]:
        """One frame in another, at the stamps of all transforms between them that move."""
        named = parse_pair(self._recording, name)
        tree = FrameTree(_HISTORY_S)
        pair = FramePair(named.parent, named.child)
        if named.static is not None:  # all of them first: they hold at all times
            for _, message in self._messages(named.static):
                self._add(tree, message, static=True)
        for _, message in self._messages(named.topic):
            self._add(tree, message)
            for stamp_ns, pose in pair.follow(tree, message):
                yield _Pose(stamp_ns, stamp_ns, pose, named.parent)
        _check_motion(self._recording, named, tree)

    def _add(self, tree: FrameTree, message: Transforms, static: bool = False) -> None:
        try:
            tree.add(message, static)
        except WrongTransforms as error:
            self._wrong_transforms.update(what for _, _, what in error.wrong)

    def _messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        with closing(self._recording.read(topics=[topic])) as entries:
            for entry in entries:
                try:
                    yield entry.stamp_ns, content(entry.message)
                except DamagedMessage as error:
                    if not self._damaged:
                        log.warning("%s: %s (further occurrences suppressed)", topic, error)
                    self._damaged += 1


def _choose(recording: Recording, but: str | None) -> str:
    there = [topic for topic in _topics_of(recording, _KINDS) if topic != but]
    for kind in _KINDS:
        of_kind = [topic for topic in _topics_of(recording, (kind,)) if topic in there]
        if len(of_kind) == 1 or (of_kind and kind is Transforms):
            return of_kind[0]
        if of_kind:
            listed = ", ".join(there)
            raise UsageError(f"{recording.path}: several topics have poses; choose one: {listed}")
    raise UsageError(f"{recording.path}: no topic with poses; see ros-visualise info")


def _find_topic(recording: Recording, wanted: str, kinds: Collection[type]) -> str:
    """The topic of that name, with or without its first slash; raises UsageError."""
    there = _topics_of(recording, kinds)
    found = [name for name in there if name.lstrip("/") == wanted.lstrip("/")]
    if not found:
        listed = f"choose from {', '.join(there)}" if there else "it has no topic with poses"
        raise UsageError(f"{recording.path}: no poses on {wanted}; {listed}")
    return found[0]


def _topics_of(recording: Recording, kinds: Collection[type]) -> list[str]:
    """The topics with messages of these kinds."""
    topics = recording.topics.items()
    return [name for name, info in topics if info.type.data_class in kinds and info.messages]


def _check_motion(recording: Recording, pair: NamedPair, tree: FrameTree) -> None:
    """Raise UsageError unless, by all transforms, the child moves in the parent."""
    try:
        newest_ns = tree.newest_ns(pair.parent, pair.child)
    except NoTransform as error:
        raise UsageError(f"{recording.path}: {error}; choose two connected frames") from None
    if newest_ns is None:
        raise UsageError(f"{recording.path}: {pair.child} does not move relative to {pair.parent}")
