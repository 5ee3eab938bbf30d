"""The landmarks of the filter: given by a map, newly seen, or rejected."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from copy import copy
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.camera_view import PLACE, CameraView, Sighting
from ros_visualise.estimation.gates import Innovation
from ros_visualise.estimation.landmark import (
    PLACE_SIZE,
    SIZE,
    KnownLandmark,
    Landmark,
    begin,
    is_consistent,
)
from ros_visualise.estimation.measuring import Pair, camera_of
from ros_visualise.estimation.points import GroundPlane, PointMatch, is_in_view, match
from ros_visualise.estimation.points import begin as begin_point
from ros_visualise.estimation.robot import core
from ros_visualise.estimation.state import State
from ros_visualise.estimation.updating import fits, update, update_each

_SIDES = 0.02  # largest relative difference between two sizes of a tag
_MOVED = 8  # images in a row that contradict a landmark, while others fit
_LEFT_ACTIVE = 12  # landmarks at least that do not rest, with all that are in view
_MORE_ACTIVE = 18  # so many more, before they rest
_MOST_ACTIVE = 90  # even while a division costs much
_MOST_CONSIDERED = 60  # landmarks of a frozen map in the state
_FORGOTTEN_NS = 20_000_000_000  # how long a pending landmark waits to be seen again
_FORGOTTEN_SOON_NS = 3_000_000_000  # if it has been seen once
_MOST_PENDING = 10


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

    ``advice`` is what the user should check if a rejection persists, by landmark or part;
    ``fits`` are the innovations of all usable landmarks, and ``ranges`` the distances of rejected
    ones as a fraction of those expected.
    """

    used: list[str] = field(default_factory=list)
    pending: list[str] = field(default_factory=list)
    rejected: dict[str, str] = field(default_factory=dict)
    advice: dict[str, str] = field(default_factory=dict)
    fits: dict[str, Innovation] = field(default_factory=dict)
    ranges: dict[str, float] = field(default_factory=dict)

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
        rules: when a new landmark may correct the robot.
    """

    def __init__(self, rules: MapRules, known: Mapping[str, KnownLandmark]) -> None:
        self.landmarks: dict[str, Landmark] = {}
        self.known = dict(known)
        self.rules = rules
        self._count = len(self.known)

    def copy(self) -> LandmarkMap:
        """An independent copy."""
        new = copy(self)
        new.landmarks, new.known = dict(self.landmarks), dict(self.known)
        return new

    def seen_from(self, R: Floats, p: Floats) -> LandmarkMap:
        """The same in another frame: T_map_frame, (3, 3) and (3,)."""
        new = self.copy()
        for name in new.landmarks:
            new._own(name).turn_to(R.T, -R.T @ p)
        return new

    def keep(self, keys: Collection[str]) -> None:
        """Forget all landmarks that a state lacks; those of the map join it again when seen."""
        for name, one in list(self.landmarks.items()):
            if not set(one.keys) <= set(keys):
                del self.landmarks[name]

    @property
    def is_frozen(self) -> bool:
        """True if the map stays unchanged."""
        return self.rules.mode is MapMode.FROZEN

    @property
    def used(self) -> list[Landmark]:
        """The landmarks that correct the robot."""
        return [one for one in self.landmarks.values() if one.is_used]

    def take(self, state: State, view: CameraView) -> tuple[State, ImageOutcome]:
        """Correct the state by an image."""
        outcome = ImageOutcome(rejected=dict(view.skipped))
        tags = self.usable(view, outcome)
        state = self.enter(state, tags)
        there = [(one, self._own(one.name)) for one in tags if one.name in self.landmarks]
        matches = self._points(state, view)
        there += [(one.sight, self._own(one.landmark.name)) for one in matches if one.landmark]
        state = self._correct(state, view, there, outcome)
        state = self._watch(state, view, there, outcome)
        if not self.is_frozen:
            self._begin(state, view, tags, outcome)
            state = self._begin_points(state, view, matches, outcome)
        return self._tidied(state, view.stamp_ns), outcome

    def usable(self, view: CameraView, outcome: ImageOutcome) -> list[Sighting]:
        """The tags of an image that have the size of the map."""
        tags = [sight for sight in view.sights if sight.has_orientation]
        return [sight for sight in tags if self._has_its_side(sight, outcome)]

    def _own(self, name: str) -> Landmark:
        """A copy of a landmark, to be changed: older beliefs keep theirs."""
        own = self.landmarks[name] = copy(self.landmarks[name])
        return own

    def enter(self, state: State, sights: Iterable[Sighting]) -> State:
        """The state with all landmarks active that are in view."""
        state, names = state.copy(), [sight.name for sight in sights]
        for name in names:
            if name in self.known and name not in self.landmarks:
                self._enter(state, name)
        there = [self.landmarks[name] for name in names if name in self.landmarks]
        state.activate(key for one in there for key in one.keys)
        return state

    def keys_of(self, sights: Iterable[Sighting]) -> dict[str, str]:
        """Names and keys of the tags in view that may be used."""
        there = [self.landmarks[one.name] for one in sights if one.name in self.landmarks]
        return {one.name: one.key for one in there if one.is_used and one.has_orientation}

    def decided(self, sights: Iterable[Sighting]) -> list[Pair]:
        """The tags in view with one reading left, whether they may be used yet or not."""
        there = [(one, self.landmarks[one.name]) for one in sights if one.name in self.landmarks]
        return [Pair(one, tag.key) for one, tag in there if len(tag.keys) == 1]

    @property
    def tags(self) -> int:
        """Number of tags that may be used."""
        known = {name for name, one in self.known.items() if not one.kind}
        return len(known.union(one.name for one in self.used if one.has_orientation))

    def _points(self, state: State, view: CameraView) -> list[PointMatch]:
        """Match the points of an image; points of the map in view join the state first."""
        sights = [sight for sight in view.sights if not sight.has_orientation]
        if not sights:
            return []
        camera = camera_of(view, state.robot)
        for name, known in self.known.items():
            is_new = known.kind and name not in self.landmarks
            if is_new and is_in_view(known.p, known.kind, view, camera):
                self._enter(state, name)
        at = state.positions()
        several = [
            one
            for one in self.landmarks.values()
            if not one.has_orientation and is_in_view(at[one.key], one.kind, view, camera)
        ]
        state.activate(one.key for one in several)
        return match(state, view, sights, several)

    def _has_its_side(self, sight: Sighting, outcome: ImageOutcome) -> bool:
        """True if the detector and the map agree on the size of a tag."""
        known = self.known.get(sight.name) or self.landmarks.get(sight.name)
        sides = (sight.side_m, known.side_m) if known else (0.0, 0.0)
        if min(sides) <= 0 or abs(sides[0] - sides[1]) <= _SIDES * max(sides):
            return True
        why = f"size {sides[0]:g} m, but {sides[1]:g} m in the map"
        outcome.reject(sight.name, why, "check the tag size given to the detector")
        return False

    def _enter(self, state: State, name: str) -> None:
        """Add a landmark of the map to the state."""
        known = self.known[name]
        size = PLACE_SIZE if name.startswith(PLACE) else SIZE
        state.add(name, known.R, known.p, known.covariance, 0.0 if known.kind else size)
        self.landmarks[name] = Landmark.known(name, known)

    def _correct(
        self,
        state: State,
        view: CameraView,
        there: list[tuple[Sighting, Landmark]],
        outcome: ImageOutcome,
    ) -> State:
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
                self._refuse(state, view, pair, landmark, fit, outcome)
            outcome.fits[landmark.name] = fit
        if not good:
            return state
        robot = np.arange(len(state.P)) < core() if self.is_frozen else None
        state = update(state, view, good, robot)
        self._drop_moved(state, outcome)
        return state

    def _refuse(
        self,
        state: State,
        view: CameraView,
        pair: Pair,
        landmark: Landmark,
        fit: Innovation,
        outcome: ImageOutcome,
    ) -> None:
        """Reject a landmark, and note how far off its distance is."""
        sigmas = math.sqrt(fit.distance2 / fit.size)
        why = f"position disagrees with the map ({sigmas:.1f} sigma)"
        outcome.reject(landmark.name, why, "has it moved?")
        (place,) = state.indices([pair.key])
        seen = [pose for pose in pair.sight.poses if pose.has_range]
        if seen:
            away = state.landmarks_p[place] - camera_of(view, state.robot).p
            measured_m = float(np.linalg.norm(seen[0].t))
            outcome.ranges[landmark.name] = measured_m / max(float(np.linalg.norm(away)), 1e-6)

    def _drop_moved(self, state: State, outcome: ImageOutcome) -> None:
        """Drop landmarks that image after image contradicts."""
        if self.is_frozen:
            return
        for name in list(outcome.rejected):
            landmark = self.landmarks.get(name)
            if landmark and landmark.is_used and landmark.rejected >= _MOVED:
                self._drop(state, landmark)
                self.known.pop(name, None)
                outcome.rejected[name] = "moved; re-estimating it"

    def _watch(
        self,
        state: State,
        view: CameraView,
        there: list[tuple[Sighting, Landmark]],
        outcome: ImageOutcome,
    ) -> State:
        """Update the landmarks that are not used yet, without correcting the robot."""
        there = [one for one in there if not one[1].is_used]
        if not there:
            return state
        pairs = [[Pair(sight, key) for key in landmark.keys] for sight, landmark in there]
        compared = iter(fits(view, [pair for several in pairs for pair in several], state))
        found = [[next(compared) for _ in several] for several in pairs]
        good = [
            pair
            for several, own in zip(pairs, found, strict=True)
            if is_consistent(own)
            for pair, fit in zip(several, own, strict=True)
            if fit.is_inlier
        ]
        state = update_each(state, view, good) if good else state.copy()
        for (_, landmark), own in zip(there, found, strict=True):
            landmark.watch(own, view, state)
            if landmark.is_contradictory:
                self._drop(state, landmark)
                why = "seen in several places"
                outcome.reject(landmark.name, why, "does it move, or is its size wrong?")
                continue
            if landmark.may_be_used(self.rules.sightings, self.rules.reach):
                landmark.is_used = True
            outcome.pending.append(landmark.name)
        return state

    def _begin(
        self, state: State, view: CameraView, sights: list[Sighting], outcome: ImageOutcome
    ) -> None:
        for sight in sights:
            is_new = sight.name not in self.landmarks and sight.name not in outcome.rejected
            if is_new and any(pose.R is not None for pose in sight.poses):
                new = self.landmarks[sight.name] = begin(state, view, sight)
                (outcome.used if new.is_used else outcome.pending).append(sight.name)

    def _begin_points(
        self, state: State, view: CameraView, matches: list[PointMatch], outcome: ImageOutcome
    ) -> State:
        """Add new points; note why others are rejected."""
        for sight, landmark, why in matches:
            if why:
                outcome.rejected[sight.name] = why
            if why or landmark or self.rules.plane is None:
                continue
            name = f"{sight.name}_{self._count + 1}"
            new = begin_point(state, view, sight, name, self.rules.plane)
            if new is not None:
                self._count += 1
                state, self.landmarks[name] = new
                outcome.pending.append(name)
        return state

    def _drop(self, state: State, landmark: Landmark) -> None:
        state.remove(*landmark.keys)
        del self.landmarks[landmark.name]

    def _tidied(self, state: State, stamp_ns: int) -> State:
        """The state without what is not needed now.

        Landmarks of a frozen map leave it if not seen for the longest time: the map still has them.
        Otherwise they rest. Pending ones that are not seen again are dropped.
        """
        several = self.landmarks.values()
        pending = sorted((one for one in several if not one.is_used), key=lambda one: one.last_ns)
        waits = {True: _FORGOTTEN_SOON_NS, False: _FORGOTTEN_NS}
        old = [one for one in pending if stamp_ns - one.last_ns > waits[one.seen == 1]]
        left = [one for one in pending if one not in old]
        for landmark in old + left[: max(len(left) - _MOST_PENDING, 0)]:
            self._drop(state, landmark)
        if not self.is_frozen and len(state.keys) <= _LEFT_ACTIVE + _MORE_ACTIVE:
            return state
        last = sorted(self.landmarks.values(), key=lambda one: one.last_ns)
        if self.is_frozen:
            for landmark in last[: max(len(last) - _MOST_CONSIDERED, 0)]:
                self._drop(state, landmark)
            return state
        in_view = sum(one.last_ns == stamp_ns for one in last)
        last = last[-max(in_view, _LEFT_ACTIVE) :]
        most = len(last) + _MORE_ACTIVE if state.is_settled else _MOST_ACTIVE
        if len(state.keys) > most:
            return state.divided({key for one in last for key in one.keys})
        return state
