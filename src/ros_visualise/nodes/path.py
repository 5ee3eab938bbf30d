"""The path of a robot."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import Any

from ros_visualise.core.params import param
from ros_visualise.core.rate import Clock, Pacer, WallClock
from ros_visualise.data import (
    Floats,
    Header,
    NavSatFix,
    Odometry,
    Path,
    PoseStamped,
    PoseWithCovarianceStamped,
    Transforms,
)
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.located import PLANE_FRAME, FramePair, Located, Locator
from ros_visualise.geometry.thinning import ThinnedPath
from ros_visualise.geometry.travel import Travel
from ros_visualise.nodes import action, node

log = logging.getLogger(__name__)

_FIRST_SECOND = range(1, 1_000_000_000)
"""Stamps, ns, where simulated time begins: before them, 0 is a time."""


@dataclass(frozen=True)
class PathParams:
    """Parameters of `PathNode`."""

    min_distance: float = param(
        0.05, "minimum distance between poses of the path, metres", min=0, max=100, slider=(0, 2)
    )
    min_angle: float = param(
        5.0,
        "minimum rotation between poses of the path, degrees; 0 keeps every pose",
        min=0,
        max=180,
        slider=(0, 45),
    )
    max_poses: int = param(
        10_000,
        "maximum number of poses in the path; beyond it, the older half is thinned out, but keeps"
        " its shape",
        min=10,
        max=100_000,
        slider=(10, 20_000),
    )
    rate: float = param(
        5.0,
        "maximum publishing rate, measured by timestamps, Hz; 0 publishes with every pose",
        min=0,
        max=100,
    )
    tf_parent: str = param(
        "",
        "frame in which tf_child is followed, using tf; leave tf_parent and tf_child empty to"
        " follow the other inputs",
    )
    tf_child: str = param("", "frame to follow, using tf; empty: follow the other inputs")


@node(
    "path",
    params=PathParams,
    inputs={
        "odom": Odometry,
        "pose": PoseStamped,
        "pose_cov": PoseWithCovarianceStamped,
        "fix": NavSatFix,
        "tf": Transforms,
    },
    outputs={"path": Path},
    latched=("path",),
    timed=True,
    frames=True,
    splittable=False,
)
class PathNode:
    """Publishes the path of a robot, starting over when time jumps or the frame changes.

    Of the inputs the first in the order of their declaration that has delivered is followed; with
    ``tf_parent`` and ``tf_child`` that pair alone. Fixes are put on the plane level at the first.
    Poses that come late, within a second, are dropped; so are those without a timestamp among
    others.
    """

    def __init__(self, params: PathParams, clock: Clock | None = None) -> None:
        self._clock = clock or WallClock()
        self._locator = Locator()
        self._pair = FramePair(params.tf_parent, params.tf_child)
        self._followed = ""
        self._is_due = self._has_grown = self._has_changed_frame = False
        self._arrival_ns = self._heard_ns = self._late = self._unstamped = 0
        self.reset()

    def reset(self) -> None:
        """Begin a new path: time jumped."""
        self._pair.reset()
        self._locator.reset()
        self._begin()

    @action("begin a new path")
    def clear(self) -> Path:
        """Begin a new path here; the answer is an empty one."""
        header = self._header
        self._begin()
        return self._track.path(header)

    def step(
        self,
        params: PathParams,
        odom: Odometry | None = None,
        pose: PoseStamped | None = None,
        pose_cov: PoseWithCovarianceStamped | None = None,
        fix: NavSatFix | None = None,
        tf: Transforms | None = None,
        arrival_ns: int = 0,
        *,
        frames: FrameTree,
    ) -> Path | None:
        """The path so far, if it has grown and is due."""
        self._arrival_ns = arrival_ns
        self._choose_pair(params)
        for name, one in (("odom", odom), ("pose", pose), ("pose_cov", pose_cov), ("fix", fix)):
            if one is not None and self._follows(name):
                self._take(one, params)
        if tf is not None and self._pair.child:
            for stamp_ns, known in self._pair.follow(frames, tf):
                self._add(Header(stamp_ns, self._pair.parent), known, params)
        return self.finish() if self._is_due else None

    def tick(self, params: PathParams) -> Path | None:
        """The path, where its last poses wait for others, and none has come for a whole period."""
        period_ns = 1e9 / params.rate if params.rate else 0
        silence_ns = self._clock.monotonic_ns() - self._heard_ns
        return self.finish() if silence_ns >= period_ns else None

    def finish(self) -> Path | None:
        """The path, if it has grown since the last time."""
        if not self._has_grown:
            return None
        self._is_due = self._has_grown = False
        return self._track.path(self._header)

    def report(self) -> dict[str, Any]:
        """The way so far, and poses that were dropped: no numbers, fix or timestamp, or late."""
        gone = self._travel.summary()
        speeds = {"mean_mps": gone.mean_mps, "top_mps": gone.top_mps}
        return {
            "poses": len(self._track),
            "length_m": round(gone.length_m, 3),
            "duration_s": round(gone.duration_s, 3),
            **{name: None if mps is None else round(mps, 3) for name, mps in speeds.items()},
            "refused": self._locator.refused
            + self._locator.without_fix
            + self._late
            + self._unstamped,
            "deviation_m": round(self._track.deviation_m, 4),
        }

    def _begin(self) -> None:
        self._track = ThinnedPath()
        self._travel = Travel()
        self._pacer = Pacer()
        self._header = Header()
        self._is_due = self._has_grown = False

    def _choose_pair(self, params: PathParams) -> None:
        wanted = (params.tf_parent, params.tf_child) if params.tf_parent else ("", "")
        if wanted != (self._pair.parent, self._pair.child):
            self._pair = FramePair(*wanted)
            self._followed = ""
            self._begin()

    def _follows(self, name: str) -> bool:
        """True if a message of this input belongs to the path; a better input begins a new one."""
        if self._pair.child:
            return False
        order = ("odom", "pose", "pose_cov", "fix", "")
        if order.index(name) < order.index(self._followed):
            self._followed = name
            if name != "odom":
                log.info("no odometry; drawing the path from the input %s", name)
            self._begin()
        return name == self._followed

    def _take(self, message: Located, params: PathParams) -> None:
        pose = self._locator.locate(message)
        if pose is None:
            return
        header = message.header
        if isinstance(message, NavSatFix):
            header = Header(header.stamp_ns, PLANE_FRAME)
        self._add(header, pose, params)

    def _add(self, header: Header, pose: Floats, params: PathParams) -> None:
        if not self._is_stamped_alike(header):
            return
        if header.frame_id != self._header.frame_id:
            self._change_frame(header.frame_id)
        if header.stamp_ns < self._header.stamp_ns:
            self._late += 1
            return
        self._header = header
        self._heard_ns = self._clock.monotonic_ns()
        self._travel.add(header.stamp_ns, pose[:3].tolist())
        if self._track.is_apart(pose, params.min_distance, math.radians(params.min_angle)):
            self._track.append(header.stamp_ns, pose, params.max_poses)
            self._has_grown = True
        time_ns = header.stamp_ns or self._arrival_ns
        if not params.rate or self._pacer.passes(time_ns, params.rate):
            self._is_due = True

    def _is_stamped_alike(self, header: Header) -> bool:
        """True if the pose and the path both have timestamps, or both do not."""
        has_stamp, had_stamp = bool(header.stamp_ns), bool(self._header.stamp_ns)
        if not len(self._track) or has_stamp == had_stamp or header.stamp_ns in _FIRST_SECOND:
            return True
        if not self._unstamped:
            log.warning("path: dropping poses without a timestamp (further occurrences suppressed)")
        self._unstamped += len(self._track) if has_stamp else 1
        if has_stamp:
            self._begin()
        return has_stamp

    def _change_frame(self, frame_id: str) -> None:
        """Begin a new path: the poses of the one before are in another frame."""
        if len(self._track) and not self._has_changed_frame:
            self._has_changed_frame = True
            what = "path: frame changed from %r to %r: starting a new path"
            log.warning(f"{what} (further occurrences suppressed)", self._header.frame_id, frame_id)
        self._begin()
