"""A belief of the navigator, at one time: the filter's state, the map, and what contradicts it.

Beliefs are not changed after their event: the next one is a copy. So measurements that come late
are put in by going on from an older belief, with the same result as if they had come in time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.landmark_map import ImageOutcome, LandmarkMap
from ros_visualise.estimation.measuring import CAMERAS
from ros_visualise.estimation.pose_search import PoseSearch
from ros_visualise.estimation.state import State
from ros_visualise.estimation.steadiness import Steadiness

_MOST_NOTES = 20
_QUIET_NS = 10_000_000_000


class Note(NamedTuple):
    """Something that users should hear of, once."""

    stamp_ns: int
    text: str


def lost(why: str, tags: int) -> str:
    """Why the robot is lost, and which of the map's tags relocalize it."""
    needed = "the only tag of the map is" if tags else "an initial pose (topic initialpose) is"
    needed = "two different map tags are" if tags > 1 else needed
    return f"lost: {why}; {needed} needed to relocalize"


@dataclass(frozen=True)
class RefusalRun:
    """Measurements of one sensor refused in a row: since when, and how many."""

    since_ns: int
    count: int = 1


class Undecided(NamedTuple):
    """A disagreement of IMU and odometry that nothing decided: their difference goes on growing.

    ``rate`` (6,) is that of the position and of a rotation about the robot, per second; its growth
    has been added up to ``until_ns``.
    """

    rate: Floats
    since_ns: int
    end_ns: int
    until_ns: int


@dataclass(frozen=True, eq=False)
class ImuTrust:
    """Agreement of the IMU with the odometry so far.

    Attributes:
        agreed_s: how long, since it was ignored last.
        disagreements: in a row.
        since_ns: beginning of these.
        rate: smoothed fraction of disagreements.
        ignored_until_ns: the odometry alone propagates the robot until then.
        back_off_s: how long it is ignored next.
        undecided: the disagreement for which it is ignored, if nothing decided that.
    """

    agreed_s: float = 0.0
    disagreements: int = 0
    since_ns: int = 0
    rate: float = 0.0
    ignored_until_ns: int = 0
    back_off_s: float = 10.0
    undecided: Undecided | None = None


@dataclass(eq=False)
class Belief:
    """The estimate at one time, and all that goes with it.

    Attributes:
        stamp_ns: its time; None before the first odometry.
        state: the filter's state.
        map: the landmarks.
        search: candidate poses while lost, or contradicted.
        is_located: True if the robot is localized.
        has_pose: True if it has ever been.
        reason: why its pose is not published; empty while it is.
        is_start_known: True if it is known where in the map the odometry began.
        contradiction: (6,) how far off the pose is if tags that contradict it are right: of the
            position, and about the robot.
        outcome: results of the last image.
        contradicted: images in a row that contradict the pose, the first at ``contradicted_ns``.
        last_print: of the last image.
        imu: how far the IMU is trusted.
        cameras: how steady each camera is on the robot.
        rival: the state by the odometry, while the trusted IMU disagrees with that.
        rival_lead: log-likelihood of tags for the rival, relative to ``state``.
        is_by_imu: True if the IMU alone has propagated it since the last odometry.
        tags_ns: time of the last image that corrected the robot.
        refusals: by sensor, while its measurements are refused.
        memory: what a sensor remembers, by its name.
        counts: of events, by name.
        notes: the last ones.
        after_odometry: the belief after the last odometry message; None if it is this one.
    """

    state: State
    map: LandmarkMap
    reason: str
    is_start_known: bool = False
    stamp_ns: int | None = None
    search: PoseSearch = field(default_factory=PoseSearch)
    is_located: bool = False
    has_pose: bool = False
    contradiction: Floats = field(default_factory=lambda: np.zeros(6))
    outcome: ImageOutcome = field(default_factory=ImageOutcome)
    contradicted: int = 0
    contradicted_ns: int = 0
    last_print: bytes = b""
    imu: ImuTrust = ImuTrust()
    cameras: tuple[Steadiness, ...] = (Steadiness(),) * len(CAMERAS)
    rival: State | None = None
    rival_lead: float = 0.0
    is_by_imu: bool = False
    tags_ns: int = -(1 << 62)
    refusals: Mapping[str, RefusalRun] = field(default_factory=dict)
    memory: Mapping[str, Any] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    notes: tuple[Note, ...] = ()
    after_odometry: Belief | None = None

    def copy(self) -> Belief:
        """A copy to be changed by the next event."""
        new = copy(self)
        new.counts = Counter(self.counts)
        return new

    @property
    def now_ns(self) -> int:
        """Its time; only after the first odometry."""
        assert self.stamp_ns is not None
        return self.stamp_ns

    def note(self, text: str) -> None:
        """Say something to the user, unless it was said a moment ago."""
        is_new = all(
            one.text != text or self.now_ns - one.stamp_ns > _QUIET_NS for one in self.notes
        )
        if is_new:
            self.notes = (*self.notes[-_MOST_NOTES + 1 :], Note(self.now_ns, text))

    def remember(self, sensor: str, value: Any) -> None:
        """Keep something for a sensor."""
        self.memory = {**self.memory, sensor: value}

    def refuse(self, sensor: str) -> RefusalRun:
        """Count a refused measurement; all refused in a row."""
        self.counts[f"{sensor} rejected"] += 1
        before = self.refusals.get(sensor)
        now = replace(before, count=before.count + 1) if before else RefusalRun(self.now_ns)
        self.refusals = {**self.refusals, sensor: now}
        return now

    def accept(self, sensor: str) -> None:
        """Count an applied measurement."""
        self.counts[f"{sensor} used"] += 1
        self.forgive(sensor)

    def forgive(self, sensor: str) -> None:
        """Begin to count anew what is refused in a row."""
        if sensor in self.refusals:
            self.refusals = {name: one for name, one in self.refusals.items() if name != sensor}

    def locate(self) -> None:
        """The robot is localized."""
        self.is_located = self.has_pose = True
        self.reason, self.contradicted, self.contradiction = "", 0, np.zeros(6)
        self.rival = None
        self.search = PoseSearch()

    def lose(self, why: str) -> None:
        """The robot is lost."""
        self.is_located = False
        self.reason = lost(why, self.map.tags)
        self.counts["losses"] += 1
        self.note(self.reason)
