"""The way that something went, out of a recording: poses of any type, fixes, paths, or tf."""

from __future__ import annotations

import logging
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import DamagedMessage, RosVisualiseError, UsageError
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
from ros_visualise.sources.frame_pairs import (
    HISTORY_S,
    ask_for_pair,
    find_topic,
    parse_pair,
    refuse_rest,
    topics_of,
)
from ros_visualise.sources.recordings import Recording

log = logging.getLogger(__name__)

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


@dataclass
class Trajectory:
    """The way on one topic.

    Attributes:
        topic: its name; of tf, with its frames.
        path: the poses in order of their stamps, in the frame of its header.
        left_out: why poses were left out -> how many.
        unordered: poses that were recorded before others of earlier stamps.
        repeated: poses that have the stamp of the one before.
        without_attitude: poses whose quaternion was zero; they have that of the frame.
        stamped: whether there are times; else all stamps are zero.
        turns: whether attitudes are known; of fixes they are not.
    """

    topic: str
    path: Path
    left_out: dict[str, int] = field(default_factory=dict)
    unordered: int = 0
    repeated: int = 0
    without_attitude: int = 0
    stamped: bool = True
    turns: bool = True


class _Pose(NamedTuple):
    """Its stamp, when it was recorded, position and quaternion (7,), and the frame of these."""

    stamp_ns: int
    recorded_ns: int
    pose: Floats
    frame_id: str


def read_trajectory(
    recording: Recording, topic: str | None = None, but: str | None = None
) -> Trajectory:
    """Read the way on a topic.

    Stamps are those of the headers or, where no header has one, when the messages were recorded.

    Args:
        recording: what to read.
        topic: its name, or that of a pair of frames, as `parse_pair`. None: the only one of the
            best type.
        but: a topic that is not to be chosen.

    Raises:
        UsageError: there is no such topic, or none is to be preferred; all are listed.
        RosVisualiseError: there are no poses on it.
    """
    reader = _Reader(recording)
    if topic is not None and ":" in topic:
        poses = reader.transforms(topic)
    else:
        topic = find_topic(recording, topic, _KINDS) if topic else _choose(recording, but)
        kind = recording.topics[topic].type.data_class
        if kind is Transforms:
            raise UsageError(ask_for_pair(recording, f"--topic {topic}"))
        poses = reader.last_path(topic) if kind is Path else reader.poses(topic)
    return _put_together(topic, list(poses), reader)


def has_poses(recording: Recording, topic: str) -> bool:
    """True if a recording has a topic of that name that a way can be read from, or such frames."""
    name = topic.partition(":")[0].lstrip("/")
    return any(name == one.lstrip("/") for one in topics_of(recording, _KINDS))


def ordered(
    topic: str,
    stamps_ns: npt.NDArray[np.int64],
    rows: Floats,
    frame_id: str,
    left_out: dict[str, int],
) -> Trajectory:
    """The trajectory of poses (N, 7) in any order: x, y, z and a quaternion x, y, z, w each.

    Raises:
        RosVisualiseError: there are none.
    """
    if not len(rows):
        why = ", ".join(f"{count} {why}" for why, count in left_out.items())
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
    return Trajectory(topic, path, left_out, unordered, repeated, without_attitude, turns=turns)


class _Reader:
    """Reads poses off a recording, and counts what says none."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._locator = Locator()
        self._wrong_transforms: Counter[str] = Counter()
        self._damaged = 0
        self.has_attitudes = True

    @property
    def left_out(self) -> dict[str, int]:
        """Why -> how many."""
        counts = {
            "without a fix": self._locator.without_fix,
            "no numbers": self._locator.refused,
            "damaged": self._damaged,
            **{f"transforms: {what}": n for what, n in self._wrong_transforms.items()},
        }
        return {why: count for why, count in counts.items() if count}

    def poses(self, topic: str) -> Iterator[_Pose]:
        """Of messages that hold one each."""
        for recorded_ns, message in self._messages(topic):
            pose = self._locator.locate(message)
            if pose is not None:
                is_fix = isinstance(message, NavSatFix)
                self.has_attitudes = not is_fix
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
        named = parse_pair(self._recording, name)
        tree = FrameTree(HISTORY_S)
        pair = FramePair(named.parent, named.child)
        if named.static is not None:  # all of them first: they hold at all times
            for _, message in self._messages(named.static):
                self._learn(tree, message, static=True)
        for _, message in self._messages(named.topic):
            self._learn(tree, message)
            for stamp_ns, pose in pair.follow(tree, message):
                yield _Pose(stamp_ns, stamp_ns, pose, named.parent)
        refuse_rest(self._recording, named, tree)

    def _learn(self, tree: FrameTree, message: Transforms, static: bool = False) -> None:
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
                        log.warning("%s: %s (said once)", topic, error)
                    self._damaged += 1


def _choose(recording: Recording, but: str | None) -> str:
    there = [topic for topic in topics_of(recording, _KINDS) if topic != but]
    for kind in _KINDS:
        of_kind = [topic for topic in topics_of(recording, (kind,)) if topic in there]
        if len(of_kind) == 1 or (of_kind and kind is Transforms):
            return of_kind[0]
        if of_kind:
            listed = ", ".join(there)
            raise UsageError(f"{recording.path}: several have poses; choose --topic of {listed}")
    raise UsageError(f"{recording.path}: no topic of poses in it; see ros-visualise info")


def _put_together(topic: str, poses: list[_Pose], reader: _Reader) -> Trajectory:
    stamps_ns = np.array([one.stamp_ns for one in poses], np.int64)
    if not stamps_ns.any():
        stamps_ns = np.array([one.recorded_ns for one in poses], np.int64)
    rows = np.array([one.pose for one in poses])
    frame_id = poses[0].frame_id if poses else ""
    found = ordered(topic, stamps_ns, rows, frame_id, reader.left_out)
    found.turns &= reader.has_attitudes
    return found
