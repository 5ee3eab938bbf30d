"""The landmarks of the filter: given by a map, newly seen, or rejected."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from ros_visualise.landmarks.navigation.camera_view import CameraView, Sighting
from ros_visualise.landmarks.navigation.landmark import (
    KnownLandmark,
    Landmark,
    begin,
    message_covariance,
)
from ros_visualise.landmarks.navigation.measuring import Pair, camera_of
from ros_visualise.landmarks.navigation.points import GroundPlane, PointMatch, match, nearby
from ros_visualise.landmarks.navigation.points import begin as begin_point
from ros_visualise.landmarks.navigation.robot import CORE
from ros_visualise.landmarks.navigation.state import FilterState
from ros_visualise.landmarks.navigation.updating import fits, update

_SIDES = 0.1  # largest relative difference between two sizes of a tag
_MOVED = 8  # images in a row that contradict a landmark, while others fit
_MOST_CONSIDERED = 60  # landmarks of a frozen map in the state


class MapMode(Enum):
    """Use of the map: build a new one, extend the given one, or leave it unchanged."""

    BUILD = "build"
    EXTEND = "extend"
    FROZEN = "frozen"


@dataclass(frozen=True)
class MapRules:
    """When a new landmark may correct the robot.

    Attributes:
        mode: see `MapMode`.
        sightings: minimum number of sightings.
        reach: minimum distance between these, as a fraction of the landmark's distance.
        plane: the ground, on which new points stand; None if unknown.
    """

    mode: MapMode = MapMode.BUILD
    sightings: int = 5
    reach: float = 0.1
    plane: GroundPlane | None = None


@dataclass
class ImageOutcome:
    """Results of an image: names of the landmarks used, still pending, and rejected with the
    reason.

    ``advice`` is what the user should check if a rejection persists, by landmark or part.
    """

    used: list[str] = field(default_factory=list)
    pending: list[str] = field(default_factory=list)
    rejected: dict[str, str] = field(default_factory=dict)
    advice: dict[str, str] = field(default_factory=dict)

    @classmethod
    def same(cls, names: Iterable[str]) -> ImageOutcome:
        """The outcome of an image identical to the previous one."""
        doubts = {"the camera": "all tag images are identical: is the camera frozen?"}
        return cls(rejected=dict.fromkeys(names, "identical image"), advice=doubts)

    def reject(self, name: str, why: str, advice: str) -> None:
        """Reject a landmark for a reason that the user can act on."""
        self.rejected[name] = why
        self.advice[name] = f"ignoring {name}: {why.partition(' (')[0]}; {advice}"


class LandmarkMap:
    """The landmarks in the state.

    Attributes:
        landmarks: by name.
        known: those of the given map, by name.
        is_frozen: True if the map stays unchanged.
    """

    def __init__(self, rules: MapRules, known: Mapping[str, KnownLandmark]) -> None:
        self.landmarks: dict[str, Landmark] = {}
        self.known = dict(known)
        self._rules = rules
        self._count = len(self.known)
        self.is_frozen = rules.mode is MapMode.FROZEN

    def take(self, state: FilterState, view: CameraView) -> tuple[FilterState, ImageOutcome]:
        """Correct the state by an image."""
        outcome = ImageOutcome(rejected=dict(view.skipped))
        tags = [sight for sight in view.sights if sight.has_orientation]
        tags = [sight for sight in tags if self._has_its_side(sight, outcome)]
        for sight in tags:
            if sight.name in self.known and sight.name not in self.landmarks:
                self._enter(state, sight.name)
        there = [(one, self.landmarks[one.name]) for one in tags if one.name in self.landmarks]
        matches = self._points(state, view)
        there += [(one.sight, one.landmark) for one in matches if one.landmark]
        state = self._correct(state, view, there, outcome)
        for sight, landmark in there:
            if not landmark.is_used:
                state = self._watch(state, view, sight, landmark, outcome)
        if not self.is_frozen:
            self._begin(state, view, tags, outcome)
            self._begin_points(state, view, matches, outcome)
        else:
            self._thin_out(state)
        return state, outcome

    def _points(self, state: FilterState, view: CameraView) -> list[PointMatch]:
        """Match the points of an image; points of the map in view join the state first."""
        sights = [sight for sight in view.sights if not sight.has_orientation]
        if not sights:
            return []
        camera = camera_of(view, state.R, state.p)
        for name, known in self.known.items():
            if known.kind and name not in self.landmarks and nearby(known, view, camera):
                self._enter(state, name)
        several = [one for one in self.landmarks.values() if not one.has_orientation]
        return match(state, view, sights, several)

    def map_of(self, state: FilterState) -> dict[str, KnownLandmark]:
        """The usable tags so far, by name."""
        known = {name: one for name, one in self.known.items() if not one.kind}
        for name, one in self.landmarks.items():
            if one.is_used:
                (place,) = state.indices([one.key])
                R, p = state.landmarks_R[place], state.landmarks_p[place]
                told = message_covariance(state, one.key)
                if one.has_orientation:
                    known[name] = KnownLandmark.of(R, p, told, one.side_m)
        return known

    def _has_its_side(self, sight: Sighting, outcome: ImageOutcome) -> bool:
        """True if the detector and the map agree on the size of a tag."""
        known = self.known.get(sight.name) or self.landmarks.get(sight.name)
        sides = (sight.side_m, known.side_m) if known else (0.0, 0.0)
        if min(sides) <= 0 or abs(sides[0] - sides[1]) <= _SIDES * max(sides):
            return True
        why = f"size {sides[0]:g} m, but {sides[1]:g} m in the map"
        outcome.reject(sight.name, why, "check the tag size given to the detector")
        return False

    def _enter(self, state: FilterState, name: str) -> None:
        """Add a landmark of the map to the state."""
        known = self.known[name]
        state.add(name, known.R, known.p, known.covariance)
        self.landmarks[name] = Landmark.known(name, known)

    def _correct(
        self,
        state: FilterState,
        view: CameraView,
        there: list[tuple[Sighting, Landmark]],
        outcome: ImageOutcome,
    ) -> FilterState:
        """Correct the state by all usable landmarks that fit."""
        there = [one for one in there if one[1].is_used]
        pairs = [Pair(sight, landmark.key) for sight, landmark in there]
        good: list[Pair] = []
        compared = zip(pairs, there, fits(view, pairs, state), strict=True)
        for pair, (_, landmark), fit in compared:
            if fit.is_inlier:
                good.append(pair)
                landmark.seen += 1
                landmark.rejected, landmark.last_ns = 0, view.stamp_ns
                outcome.used.append(landmark.name)
            else:
                landmark.rejected += 1
                sigmas = math.sqrt(fit.distance2 / fit.size)
                why = f"position disagrees with the map ({sigmas:.1f} sigma)"
                outcome.reject(landmark.name, why, "has it moved?")
        if not good:
            return state
        state = update(state, view, good, [slice(0, CORE if self.is_frozen else None)])
        self._drop_moved(state, outcome)
        return state

    def _drop_moved(self, state: FilterState, outcome: ImageOutcome) -> None:
        """Drop landmarks that image after image contradicts."""
        if self.is_frozen:
            return
        for name in list(outcome.rejected):
            landmark = self.landmarks.get(name)
            if landmark and landmark.is_used and landmark.rejected >= _MOVED:
                self._drop(state, landmark)
                self.known.pop(name, None)
                outcome.rejected[name] = "moved; estimated anew"

    def _watch(
        self,
        state: FilterState,
        view: CameraView,
        sight: Sighting,
        landmark: Landmark,
        outcome: ImageOutcome,
    ) -> FilterState:
        """Update a landmark that is not used yet."""
        state = landmark.watch(state, view, sight)
        if landmark.is_contradictory:
            self._drop(state, landmark)
            why = "seen in several places"
            outcome.reject(landmark.name, why, "does it move, or is its size wrong?")
            return state
        if landmark.may_be_used(self._rules.sightings, self._rules.reach):
            landmark.is_used = True
        outcome.pending.append(landmark.name)
        return state

    def _begin(
        self, state: FilterState, view: CameraView, sights: list[Sighting], outcome: ImageOutcome
    ) -> None:
        for sight in sights:
            is_new = sight.name not in self.landmarks and sight.name not in outcome.rejected
            if is_new and any(pose.R is not None for pose in sight.poses):
                self.landmarks[sight.name] = begin(state, view, sight)
                outcome.pending.append(sight.name)

    def _begin_points(
        self, state: FilterState, view: CameraView, matches: list[PointMatch], outcome: ImageOutcome
    ) -> None:
        """Add new points; note why others are rejected."""
        for sight, landmark, why in matches:
            if why:
                outcome.rejected[sight.name] = why
            if why or landmark or self._rules.plane is None:
                continue
            name = f"{sight.name}_{self._count + 1}"
            new = begin_point(state, view, sight, name, self._rules.plane)
            if new is not None:
                self._count += 1
                self.landmarks[name] = new
                outcome.pending.append(name)

    def _drop(self, state: FilterState, landmark: Landmark) -> None:
        for key in landmark.keys:
            state.remove(key)
        del self.landmarks[landmark.name]

    def _thin_out(self, state: FilterState) -> None:
        """Drop the landmarks not seen for the longest time; the map still has them."""
        several = sorted(self.landmarks.values(), key=lambda one: one.last_ns)
        for landmark in several[: max(len(several) - _MOST_CONSIDERED, 0)]:
            self._drop(state, landmark)
