"""Where the robot may be, while nobody knows, or while all that is seen contradicts the estimate.

Each reading of a tag that is in the map is one place where the robot may be. Each such place is
followed by a filter of its own, until the images decide between them.
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

_MOST = 8  # places that are followed at a time
_LEAST_VIEWS = 3
_WORST = -40.0  # what a tag that does not fit adds to the evidence
_MISSES = 3  # images in a row without anything that fits, after which a place is given up
_SAME_M, _SAME_RAD = 0.3, 0.1
_VAGUER = 16.0  # than the picture: it only tells where to begin, and counts when it is compared


@dataclass(eq=False)
class PoseCandidate:
    """Where the robot may be: a state of its own, in which the map's landmarks are considered.

    Attributes:
        evidence: logarithm of how likely the images are there, relative to the others.
        names: of the landmarks that fit.
        views: how many images fit.
        misses: how many in a row did not.
    """

    state: FilterState
    evidence: float
    names: set[str] = field(default_factory=set)
    views: int = 0
    misses: int = 0


class SearchPrior(NamedTuple):
    """What is known wherever the robot is.

    Attributes:
        up: (3,) in the robot's axes, as the odometry has it.
        level_rad: standard deviation of how level the odometry's frame is.
        odometry: what it does wrong.
    """

    up: Floats
    level_rad: float
    odometry: OdometryNoise


class PoseSearch:
    """The places where the robot may be."""

    def __init__(self) -> None:
        self.places: list[PoseCandidate] = []

    def clear(self) -> None:
        """Forget all of them."""
        self.places = []

    def predict(self, steps: Sequence[OdometryStep], model: OdometryNoise) -> None:
        """Go on by what the odometry tells."""
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
        """The landmarks that the likeliest place was told by."""
        return self.places[0].names if self.places else set()

    def found(self, least_names: int) -> FilterState | None:
        """The state at the one place that is left; None while that is not decided."""
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
        """Begin at each reading of each tag."""
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
        """Let a place have an image."""
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
        """Keep the likeliest, each once."""
        kept: list[PoseCandidate] = []
        for place in sorted(self.places, key=lambda one: -one.evidence):
            if len(kept) < _MOST and not any(_are_same(place.state, one.state) for one in kept):
                kept.append(place)
        self.places = kept


def _stand(
    view: CameraView, known: KnownLandmark, pose: ObservedPose, model: OdometryNoise
) -> FilterState:
    """The robot where it sees a landmark of the map in one reading."""
    assert pose.R is not None
    R_camera = known.R @ pose.R.T
    p_camera = known.p - R_camera @ pose.t
    R = R_camera @ view.R_base_camera.T
    state = FilterState()
    covariance = known.covariance + _VAGUER * seen_noise(pose, R_camera, p_camera)
    begin(state, R, p_camera - R @ view.p_base_camera, covariance, model)
    return state


def _are_same(one: FilterState, other: FilterState) -> bool:
    """Whether two places have become one."""
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
