"""Global localization: candidate poses while the robot is lost or all sightings contradict its
pose.

Each reading of a map tag gives one candidate, followed by a filter of its own until the images
decide between them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.camera_view import CameraView, ObservedPose, Sighting
from ros_visualise.estimation.gates import DECIDED, WORST
from ros_visualise.estimation.landmark import seen_noise
from ros_visualise.estimation.localization.track import log_score
from ros_visualise.estimation.measuring import CAMERAS, TURN, Pair, camera_of, turn_of
from ros_visualise.estimation.odometry import (
    OdometryNoise,
    OdometryStep,
    place_robot,
    propagate_by_odometry,
)
from ros_visualise.estimation.robot import POSE, core
from ros_visualise.estimation.state import State
from ros_visualise.estimation.updating import fits, level, update
from ros_visualise.geometry import se3

_MOST = 8  # candidates followed at a time
_LEAST_VIEWS = 3
_MISSES = 3  # images in a row without a match after which a candidate is dropped
_SAME_M, _SAME_RAD = 0.3, 0.1
_VAGUER = 100.0  # factor on the first covariance: the same image is compared again afterwards


@dataclass(eq=False)
class PoseCandidate:
    """A candidate pose: a state in which landmarks are considered, not estimated.

    Attributes:
        evidence: log-likelihood of the images, relative to the other candidates.
        names: landmarks that fit.
        views: number of images that fit.
        misses: number of consecutive images that do not.
    """

    state: State
    evidence: float
    names: frozenset[str] = frozenset()
    views: int = 0
    misses: int = 0


class SearchPrior(NamedTuple):
    """Prior knowledge, the same for all candidates of an image.

    Attributes:
        up: (3,) the odometry's vertical, in the robot's axes.
        level_rad: standard deviation of the tilt of the odometry's frame.
        odometry: its errors.
        turn_rad: standard deviation of the camera's attitude on the robot.
    """

    up: Floats
    level_rad: float
    odometry: OdometryNoise
    turn_rad: float


class PoseSearch:
    """The candidate poses of the robot."""

    def __init__(self) -> None:
        self.places: list[PoseCandidate] = []

    def copy(self) -> PoseSearch:
        """An independent copy."""
        new = PoseSearch()
        new.places = [copy(place) for place in self.places]
        return new

    def clear(self) -> None:
        """Drop all candidates."""
        self.places = []

    def predict(self, steps: Sequence[OdometryStep], model: OdometryNoise) -> None:
        """Propagate all candidates by odometry."""
        for place in self.places:
            place.state = place.state.copy()
            for step in steps:
                propagate_by_odometry(place.state, step, model)

    def look(
        self, view: CameraView, state: State, keys: Mapping[str, str], prior: SearchPrior
    ) -> None:
        """Compare with an image.

        Args:
            state: the present state, with all landmarks in view that may be used.
            keys: their names and keys.
        """
        sights = [sight for sight in view.sights if sight.name in keys]
        if not sights:
            return
        for place in self.places:
            place.state = completed(place.state, state, list(keys.values()))
            self._compare(place, view, sights, keys)
        self.places = [one for one in self.places if one.misses < _MISSES]
        if not any(one.misses == 0 for one in self.places):
            self._begin(view, sights, state, keys, prior)
        self._thin_out()

    @property
    def names(self) -> frozenset[str]:
        """The landmarks that support the likeliest candidate."""
        return self.places[0].names if self.places else frozenset()

    def found(self, least_names: int) -> State | None:
        """The state of the only remaining candidate; None while undecided."""
        if not self.places:
            return None
        first, *others = self.places
        enough = first.views >= _LEAST_VIEWS and len(first.names) >= least_names
        decided = all(first.evidence - one.evidence > DECIDED for one in others)
        return first.state if enough and decided and first.misses == 0 else None

    def _begin(
        self,
        view: CameraView,
        sights: list[Sighting],
        state: State,
        keys: Mapping[str, str],
        prior: SearchPrior,
    ) -> None:
        """Add a candidate for each reading of each tag."""
        start = max((one.evidence for one in self.places), default=0.0)
        for sight in sights:
            for pose in sight.poses:
                if pose.R is None:
                    continue
                there = _stand(view, state, keys[sight.name], pose, prior)
                there, fit = level(there, prior.up, prior.level_rad)
                if not fit.is_inlier:
                    continue
                place = PoseCandidate(there, start + fit.evidence + log_score(pose.score))
                self._compare(place, view, sights, keys)
                if place.misses == 0:
                    self.places.append(place)

    @staticmethod
    def _compare(
        place: PoseCandidate, view: CameraView, sights: list[Sighting], keys: Mapping[str, str]
    ) -> None:
        """Update a candidate by an image."""
        pairs = [Pair(sight, keys[sight.name]) for sight in sights]
        found = fits(view, pairs, place.state)
        place.evidence += sum(max(one.evidence, WORST) for one in found)
        good = [pair for pair, one in zip(pairs, found, strict=True) if one.is_inlier]
        if not good:
            place.misses += 1
            return
        robot = np.arange(len(place.state.P)) < core()
        place.state = update(place.state, view, good, robot)
        place.misses = 0
        place.views += 1
        place.names |= {pair.sight.name for pair in good}

    def _thin_out(self) -> None:
        """Keep the likeliest candidates, without duplicates."""
        kept: list[PoseCandidate] = []
        for place in sorted(self.places, key=lambda one: -one.evidence):
            if len(kept) < _MOST and not any(_are_same(place.state, one.state) for one in kept):
                kept.append(place)
        self.places = kept


def completed(other: State, state: State, keys: Sequence[str]) -> State:
    """Another state that began without some of the landmarks in view, with these."""
    missing = [key for key in keys if key not in other.keys]
    if not missing:
        return other
    other = other.copy()
    other.activate(key for key in missing if _rests(other, key))
    for key in missing:
        if key not in other.keys:  # new from the map, independent of all others
            n, rows, size = state.keys.index(key), state.rows(key), state.size_of(key).start
            P, sigma = state.P[rows, rows], math.sqrt(state.P[size, size])
            other.add(key, state.landmarks_R[n], state.landmarks_p[n], P, sigma)
    return other


def _rests(state: State, key: str) -> bool:
    return state.resting is not None and key in state.resting.left


def _stand(
    view: CameraView, state: State, key: str, pose: ObservedPose, prior: SearchPrior
) -> State:
    """The state with the robot where one reading of a landmark places it.

    The robot then has the landmark's error, that of the reading, and those of the camera's attitude
    and clock: without these, its tilt and velocity would be certain, and wrong. The attitude may
    have been part of what was wrong before, and is unknown again.
    """
    assert pose.R is not None
    n, own = state.keys.index(key), CAMERAS[view.camera]
    R_camera = state.landmarks_R[n] @ pose.R.T
    p_camera = state.landmarks_p[n] - R_camera @ pose.t
    placed, turn = state.copy(), turn_of(view.camera)
    errors = state.robot[own].copy()
    errors[TURN] = 0
    camera = camera_of(view, state.robot.with_own(own, errors))
    back = R_camera @ camera.R.T
    R, p = back @ state.robot.R, p_camera + back @ (state.robot.p - camera.p)
    seen = _VAGUER * seen_noise(pose, R_camera, p_camera)
    place_robot(placed, R, p, seen, prior.odometry)
    robot = placed.robot.with_own(own, errors)
    v, rates = back @ state.robot.v, back @ state.robot.rates
    placed.robot = replace(robot, v=v, rates=rates)
    placed.forget(turn)
    placed.inflate(turn, np.eye(3) * prior.turn_rad**2)
    by_camera = camera_of(view, placed.robot).by_camera
    placed.share(POSE, -by_camera, slice(own.rows.start, own.rows.start + by_camera.shape[1]))
    placed.share(POSE, np.eye(6), placed.rows(key))
    return placed


def apart(one: State, other: State) -> Floats:
    """(6,) from the robot of the other state to that of one: of the position, and about itself."""
    a, b = one.robot, other.robot
    return np.concatenate([a.p - b.p, se3.turn_between(a.R, b.R)])


def _are_same(one: State, other: State) -> bool:
    """True if two candidates have converged."""
    a, b = one.robot, other.robot
    cosine = (np.trace(a.R @ b.R.T) - 1) / 2
    near = np.linalg.norm(a.p - b.p) < _SAME_M and cosine > np.cos(_SAME_RAD)
    return bool(near or _distance2(a.R, a.p, b.R, b.p, one.P[POSE, POSE] + other.P[POSE, POSE]) < 1)


def _distance2(R: Floats, p: Floats, other_R: Floats, other_p: Floats, spread: Floats) -> float:
    turn = other_R @ R.T
    if np.trace(turn) < 1:
        return np.inf
    off = np.concatenate([other_p - turn @ p, se3.rotation_vector(turn)])
    return float(off @ np.linalg.lstsq(spread, off, rcond=1e-12)[0])
