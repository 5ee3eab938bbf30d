"""Global localization: candidate poses while the robot is lost or all sightings contradict its
pose.

Each reading of a map tag gives one candidate, followed by a filter of its own until the images
decide between them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.localization.track import DECIDED, log_score
from ros_visualise.landmarks.navigation.camera_view import CameraView, ObservedPose, Sighting
from ros_visualise.landmarks.navigation.landmark import KnownLandmark, seen_noise
from ros_visualise.landmarks.navigation.measuring import Pair
from ros_visualise.landmarks.navigation.motion import OdometryNoise, OdometryStep, begin, predict
from ros_visualise.landmarks.navigation.robot import CORE, POSE
from ros_visualise.landmarks.navigation.state import FilterState
from ros_visualise.landmarks.navigation.updating import fits, level, update

_MOST = 8  # candidates followed at a time
_LEAST_VIEWS = 3
_WORST = -40.0  # evidence added by a tag that does not fit
_MISSES = 3  # images in a row without a match after which a candidate is dropped
_SAME_M, _SAME_RAD = 0.3, 0.1
_VAGUER = 16.0  # factor on the first covariance: the same image is compared again afterwards


@dataclass(eq=False)
class PoseCandidate:
    """A candidate pose: a state in which the map's landmarks are considered, not estimated.

    Attributes:
        evidence: log-likelihood of the images, relative to the other candidates.
        names: landmarks that fit.
        views: number of images that fit.
        misses: number of consecutive images that do not.
    """

    state: FilterState
    evidence: float
    names: set[str] = field(default_factory=set)
    views: int = 0
    misses: int = 0


class SearchPrior(NamedTuple):
    """Prior knowledge, the same for all candidates.

    Attributes:
        up: (3,) the odometry's vertical, in the robot's axes.
        level_rad: standard deviation of the tilt of the odometry's frame.
        odometry: its errors.
    """

    up: Floats
    level_rad: float
    odometry: OdometryNoise


class PoseSearch:
    """The candidate poses of the robot."""

    def __init__(self) -> None:
        self.places: list[PoseCandidate] = []

    def clear(self) -> None:
        """Drop all candidates."""
        self.places = []

    def predict(self, steps: Sequence[OdometryStep], model: OdometryNoise) -> None:
        """Propagate all candidates by odometry."""
        for place in self.places:
            place.state = predict(place.state, steps, model)

    def look(
        self, view: CameraView, known: Mapping[str, KnownLandmark], prior: SearchPrior
    ) -> None:
        """Compare with an image; ``known`` is the map, by name."""
        sights = [sight for sight in view.sights if sight.name in known]
        if not sights:
            return
        for place in self.places:
            self._compare(place, view, sights, known)
        self.places = [one for one in self.places if one.misses < _MISSES]
        if not any(one.misses == 0 for one in self.places):
            self._begin(view, sights, known, prior)
        self._thin_out()

    @property
    def names(self) -> set[str]:
        """The landmarks that support the likeliest candidate."""
        return self.places[0].names if self.places else set()

    def found(self, least_names: int) -> FilterState | None:
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
        known: Mapping[str, KnownLandmark],
        prior: SearchPrior,
    ) -> None:
        """Add a candidate for each reading of each tag."""
        start = max((one.evidence for one in self.places), default=0.0)
        for sight in sights:
            for pose in sight.poses:
                if pose.R is None:
                    continue
                state = _stand(view, known[sight.name], pose, prior.odometry)
                state, fit = level(state, prior.up, prior.level_rad)
                if not fit.is_inlier:
                    continue
                evidence = start + fit.evidence + log_score(pose.score)
                place = PoseCandidate(state, evidence)
                self._compare(place, view, sights, known)
                if place.misses == 0:
                    self.places.append(place)

    def _compare(
        self,
        place: PoseCandidate,
        view: CameraView,
        sights: list[Sighting],
        known: Mapping[str, KnownLandmark],
    ) -> None:
        """Update a candidate by an image."""
        state = place.state
        for sight in sights:
            if sight.name not in state.keys:
                one = known[sight.name]
                state.add(sight.name, one.R, one.p, one.covariance)
        pairs = [Pair(sight, sight.name) for sight in sights]
        found = fits(view, pairs, state)
        place.evidence += sum(max(one.evidence, _WORST) for one in found)
        good = [pair for pair, one in zip(pairs, found, strict=True) if one.is_inlier]
        if not good:
            place.misses += 1
            return
        place.state = update(state, view, good, [slice(0, CORE)])
        place.misses = 0
        place.views += 1
        place.names |= {pair.key for pair in good}

    def _thin_out(self) -> None:
        """Keep the likeliest candidates, without duplicates."""
        kept: list[PoseCandidate] = []
        for place in sorted(self.places, key=lambda one: -one.evidence):
            if len(kept) < _MOST and not any(_are_same(place.state, one.state) for one in kept):
                kept.append(place)
        self.places = kept


def _stand(
    view: CameraView, known: KnownLandmark, pose: ObservedPose, model: OdometryNoise
) -> FilterState:
    """The robot from one reading of a map landmark."""
    assert pose.R is not None
    R_camera = known.R @ pose.R.T
    p_camera = known.p - R_camera @ pose.t
    R = R_camera @ view.R_base_camera.T
    state = FilterState()
    covariance = known.covariance + _VAGUER * seen_noise(pose, R_camera, p_camera)
    begin(state, R, p_camera - R @ view.p_base_camera, covariance, model)
    return state


def _are_same(one: FilterState, other: FilterState) -> bool:
    """True if two candidates have converged."""
    off = np.linalg.norm(one.p - other.p)
    cosine = (np.trace(one.R @ other.R.T) - 1) / 2
    spread = one.covariance[POSE, POSE] + other.covariance[POSE, POSE]
    near = off < _SAME_M and cosine > np.cos(_SAME_RAD)
    return bool(near or _distance2(one, other, spread) < 1.0)


def _distance2(one: FilterState, other: FilterState, spread: Floats) -> float:
    turn = other.R @ one.R.T
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    if np.trace(turn) < 1:
        return np.inf
    off = np.concatenate([other.p - turn @ one.p, axis])
    return float(off @ np.linalg.lstsq(spread, off, rcond=1e-12)[0])
