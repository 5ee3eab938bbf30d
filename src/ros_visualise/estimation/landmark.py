"""One landmark of the navigator: its place in the state, and when it may correct the robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.camera_view import CameraView, ObservedPose, Sighting
from ros_visualise.estimation.gates import DECIDED, WORST, Innovation, MisfitTest
from ros_visualise.estimation.localization.common_error import beside
from ros_visualise.estimation.localization.track import log_score
from ros_visualise.estimation.measuring import CAMERAS, FOCAL, camera_of
from ros_visualise.estimation.robot import POSE
from ros_visualise.estimation.state import State
from ros_visualise.geometry.se3 import about_origin, adjoint

SIZE = 0.01
"""Standard deviation of a tag's size, as a fraction: of how it was printed and measured."""
PLACE_SIZE = 0.03
"""The same of a place: of its depths, which the odometry gives."""

_SAME = 1.0  # squared distance below which two readings are merged


@dataclass(frozen=True, eq=False)
class KnownLandmark:
    """A landmark of a map.

    ``covariance`` (6, 6) is of its twist, ``side_m`` the side of a tag. ``kind`` is the class of a
    point, which has no orientation; it is empty for a tag, which is unique by its name.
    """

    R: Floats
    p: Floats
    covariance: Floats
    side_m: float
    kind: str = ""
    number: int = -1

    @classmethod
    def of(
        cls, R: Floats, p: Floats, covariance: Floats, side_m: float, common: Floats | None = None
    ) -> KnownLandmark:
        """A landmark with the covariance (6, 6) of messages and maps, about the landmark itself.

        Args:
            common: (6, 6) part of it that all landmarks of the map share.
        """
        change = about_origin(p)
        twist = change @ covariance @ change.T
        return cls(R, p, twist if common is None else beside(twist, common), side_m)

    @classmethod
    def point(cls, p: Floats, covariance: Floats, kind: str, number: int) -> KnownLandmark:
        """A landmark without orientation, with the covariance (6, 6) of its position."""
        spread = np.zeros((6, 6))
        spread[:3, :3] = covariance[:3, :3]
        return cls(np.eye(3), p, spread, 0.0, kind, number)


@dataclass(eq=False)
class Landmark:
    """A landmark, apart from its estimate, which is in the state.

    Attributes:
        name: its class, followed by a number for points.
        kind, number: its class.
        side_m: side of a tag; 0 for others.
        keys: its readings in the state, the likeliest first.
        evidence: log-likelihood of the views for each reading.
        is_used: True if it corrects the robot; before that, only it is estimated.
        seen, last_ns: number of sightings, and time of the last.
        rejected: number of consecutive rejections.
    """

    name: str
    kind: str
    number: int
    side_m: float
    keys: list[str]
    evidence: list[float]
    is_used: bool
    last_ns: int
    seen: int = 1
    rejected: int = 0
    has_orientation: bool = True
    _from_p: Floats = field(default_factory=lambda: np.zeros(3))
    _reach: float = 0.0  # distance between its views, as a fraction of its range
    _misfit: MisfitTest = field(default_factory=MisfitTest)

    @classmethod
    def first(
        cls,
        sight: Sighting,
        name: str,
        keys: list[str],
        evidence: list[float],
        view: CameraView,
        at: Floats,
    ) -> Landmark:
        """A landmark seen for the first time, from a camera at ``at`` (3,)."""
        number, side_m, stamp_ns = sight.number, sight.side_m, view.stamp_ns
        new = cls(name, sight.name, number, side_m, keys, evidence, sight.is_place, stamp_ns)
        new.has_orientation, new._from_p = sight.has_orientation, at
        return new

    @classmethod
    def known(cls, name: str, one: KnownLandmark) -> Landmark:
        """A landmark of a map, usable at once."""
        kind = one.kind or name
        new = cls(name, kind, one.number, one.side_m, [name], [0.0], True, 0, 0)
        new.has_orientation = not one.kind
        return new

    @property
    def key(self) -> str:
        """Its likeliest reading."""
        return self.keys[0]

    @property
    def weights(self) -> list[float]:
        """Probability of each reading."""
        likely = [math.exp(one - self.evidence[0]) for one in self.evidence]
        return [one / sum(likely) for one in likely]

    def watch(self, found: Sequence[Innovation], view: CameraView, state: State) -> None:
        """Note a view of a landmark that is not used yet.

        Args:
            found: the innovation of each of its readings.
            state: updated by those that fit; unlikely readings are removed from it.
        """
        if not is_consistent(found):
            self.rejected += 1
            return
        self._note(max(found, key=lambda one: one.evidence), view, state)
        several = zip(self.evidence, found, strict=True)
        self.evidence = [before + max(one.evidence, WORST) for before, one in several]
        self.decide(state)

    def turn_to(self, R: Floats, p: Floats) -> None:
        """Go over to another frame of the map: T_frame_map, (3, 3) and (3,)."""
        self._from_p = R @ self._from_p + p

    def decide(self, state: State) -> None:
        """Drop readings that the views make unlikely, and merge those that have converged."""
        order = sorted(range(len(self.keys)), key=lambda n: -self.evidence[n])
        kept: list[int] = []
        for n in order:
            is_likely = not kept or self.evidence[n] > self.evidence[kept[0]] - DECIDED
            same = any(self._are_same(state, self.keys[n], self.keys[k]) for k in kept)
            if is_likely and not same:
                kept.append(n)
        state.remove(*(self.keys[n] for n in order if n not in kept))
        self.keys, self.evidence = [self.keys[n] for n in kept], [self.evidence[n] for n in kept]

    def may_be_used(self, sightings: int, reach: float) -> bool:
        """True if consistent views from distant enough places confirm it."""
        return len(self.keys) == 1 and self.seen >= sightings and self._reach >= reach

    @property
    def is_contradictory(self) -> bool:
        """True if its views are inconsistent."""
        return self.rejected > 3 or self._misfit.is_misfit

    def _note(self, fit: Innovation, view: CameraView, state: State) -> None:
        """Count a view."""
        self.seen += 1
        self.rejected = 0
        self.last_ns = view.stamp_ns
        self._misfit = self._misfit.after(fit)
        camera = camera_of(view, state.robot).p
        (place,) = state.indices([self.key])
        range_m = float(np.linalg.norm(state.landmarks_p[place] - camera))
        self._reach = max(self._reach, float(np.linalg.norm(camera - self._from_p)) / range_m)

    @staticmethod
    def _are_same(state: State, one: str, other: str) -> bool:
        a, b = state.indices([one, other])
        ahead = adjoint(state.landmarks_R[a], state.landmarks_p[a])
        back = np.linalg.inv(ahead)
        p = state.landmarks_R[a].T @ (state.landmarks_p[b] - state.landmarks_p[a])
        R = state.landmarks_R[a].T @ state.landmarks_R[b]
        axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
        off = np.concatenate([p, axis])
        P = state.P
        rows_a, rows_b = state.rows(one), state.rows(other)
        spread = back @ (P[rows_a, rows_a] + P[rows_b, rows_b]) @ back.T
        return bool(np.trace(R) > 1 and off @ np.linalg.solve(spread, off) < _SAME)


def is_consistent(found: Sequence[Innovation]) -> bool:
    """True if the likeliest reading of a landmark fits its view."""
    return max(found, key=lambda one: one.evidence).is_inlier


def begin(state: State, view: CameraView, sight: Sighting) -> Landmark:
    """Add a newly seen landmark to a state, with each reading of its image."""
    camera = camera_of(view, state.robot)
    keys = [f"{sight.name}/{n}" for n, pose in enumerate(sight.poses) if pose.R is not None]
    poses = [pose for pose in sight.poses if pose.R is not None]
    for key, pose in zip(keys, poses, strict=True):
        assert pose.R is not None
        noise, away = seen_noise(pose, camera.R, camera.p), camera.R @ pose.t
        size = PLACE_SIZE if sight.is_place else SIZE
        state.add(key, camera.R @ pose.R, away + camera.p, noise, size)
        further = np.concatenate([away, np.zeros(3)])[:, None]
        state.share(state.rows(key), further, state.size_of(key))
        state.share(state.rows(key), np.eye(6), POSE)
        start = CAMERAS[view.camera].rows.start
        state.share(state.rows(key), camera.by_camera, slice(start, start + FOCAL))
    evidence = [log_score(pose.score) for pose in poses]
    landmark = Landmark.first(sight, sight.name, keys, evidence, view, camera.p)
    landmark.decide(state)
    return landmark


def seen_noise(pose: ObservedPose, R: Floats, p: Floats) -> Floats:
    """(6, 6) covariance of a landmark's twist in the map due to a reading.

    Args:
        R, p: pose of the camera in the map.
    """
    change = adjoint(R, p) @ about_origin(pose.t)
    noise: Floats = change @ pose.covariance @ change.T
    return noise
