"""The landmarks of the filter: those of a map, those that are new, and those that are refused."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from ros_visualise.landmarks.navigation.camera_view import CameraView, Sighting
from ros_visualise.landmarks.navigation.landmark import (
    KnownLandmark,
    Landmark,
    begin,
    told_covariance,
)
from ros_visualise.landmarks.navigation.measuring import Pair, camera_of
from ros_visualise.landmarks.navigation.points import GroundPlane, PointMatch, match, nearby
from ros_visualise.landmarks.navigation.points import begin as begin_point
from ros_visualise.landmarks.navigation.robot import CORE
from ros_visualise.landmarks.navigation.state import FilterState
from ros_visualise.landmarks.navigation.updating import fits, update

_SIDES = 0.1  # by which two sides of one tag may differ, as a part
_MOVED = 8  # images in a row in which it is not where it should be, while others are
_MOST_CONSIDERED = 60  # landmarks of a map that does not change, that the state holds


class MapMode(Enum):
    """What is done with the map: begun, gone on with, or left as it is."""

    BUILD = "build"
    EXTEND = "extend"
    FROZEN = "frozen"


@dataclass(frozen=True)
class MapRules:
    """When a new landmark may correct the robot.

    Attributes:
        mode: see `MapMode`.
        sightings: it was seen so often,
        reach: from places that are apart by this part of its range.
        plane: the ground, where new points stand; None where nobody knows.
    """

    mode: MapMode = MapMode.BUILD
    sightings: int = 5
    reach: float = 0.1
    plane: GroundPlane | None = None


@dataclass
class ImageOutcome:
    """What became of the sights of an image: names, and why they are refused.

    ``doubts`` are what a person should look at where it stays so, by what it is about.
    """

    used: list[str] = field(default_factory=list)
    watched: list[str] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)
    doubts: dict[str, str] = field(default_factory=dict)

    @classmethod
    def same(cls, names: Iterable[str]) -> ImageOutcome:
        """Of an image that is the one before again."""
        doubts = {"the camera": "images with tags are all the same: is the camera frozen?"}
        return cls(refused=dict.fromkeys(names, "the same image"), doubts=doubts)

    def refuse(self, name: str, why: str, advice: str) -> None:
        """A landmark is refused, and somebody can do something about it."""
        self.refused[name] = why
        self.doubts[name] = f"{name} is left out, as it {why.partition(':')[0]}: {advice}"


class LandmarkMap:
    """The landmarks that are in the state.

    Attributes:
        landmarks: by name.
        known: those of the map that was given, by name.
        is_frozen: they stay as they are.
    """

    def __init__(self, rules: MapRules, known: Mapping[str, KnownLandmark]) -> None:
        self.landmarks: dict[str, Landmark] = {}
        self.known = dict(known)
        self._rules = rules
        self._count = len(self.known)
        self.is_frozen = rules.mode is MapMode.FROZEN

    def take(self, state: FilterState, view: CameraView) -> tuple[FilterState, ImageOutcome]:
        """Correct the state by an image."""
        judged = ImageOutcome(refused=dict(view.left_out))
        tags = [sight for sight in view.sights if sight.is_turned]
        tags = [sight for sight in tags if self._has_its_side(sight, judged)]
        for sight in tags:
            if sight.name in self.known and sight.name not in self.landmarks:
                self._enter(state, sight.name)
        there = [(one, self.landmarks[one.name]) for one in tags if one.name in self.landmarks]
        matches = self._points(state, view)
        there += [(one.sight, one.landmark) for one in matches if one.landmark]
        state = self._correct(state, view, there, judged)
        for sight, landmark in there:
            if not landmark.is_used:
                state = self._watch(state, view, sight, landmark, judged)
        if not self.is_frozen:
            self._begin(state, view, tags, judged)
            self._begin_points(state, view, matches, judged)
        else:
            self._thin_out(state)
        return state, judged

    def _points(self, state: FilterState, view: CameraView) -> list[PointMatch]:
        """Which points are seen; those of the map that may be are in the state by then."""
        sights = [sight for sight in view.sights if not sight.is_turned]
        if not sights:
            return []
        camera = camera_of(view, state.R, state.p)
        for name, known in self.known.items():
            if known.kind and name not in self.landmarks and nearby(known, view, camera):
                self._enter(state, name)
        several = [one for one in self.landmarks.values() if not one.is_turned]
        return match(state, view, sights, several)

    def map_of(self, state: FilterState) -> dict[str, KnownLandmark]:
        """All that is known by now of tags that may be used, by name."""
        known = {name: one for name, one in self.known.items() if not one.kind}
        for name, one in self.landmarks.items():
            if one.is_used:
                (place,) = state.indices([one.key])
                R, p = state.landmarks_R[place], state.landmarks_p[place]
                told = told_covariance(state, one.key)
                if one.is_turned:
                    known[name] = KnownLandmark.of(R, p, told, one.side_m)
        return known

    def _has_its_side(self, sight: Sighting, judged: ImageOutcome) -> bool:
        """Whether its detector and the map agree on how large it is."""
        known = self.known.get(sight.name) or self.landmarks.get(sight.name)
        sides = (sight.side_m, known.side_m) if known else (0.0, 0.0)
        if min(sides) <= 0 or abs(sides[0] - sides[1]) <= _SIDES * max(sides):
            return True
        why = f"is {sides[0]:g} m wide here and {sides[1]:g} m in the map"
        judged.refuse(sight.name, why, "check the size that its detector was given")
        return False

    def _enter(self, state: FilterState, name: str) -> None:
        """Take a landmark of the map into the state."""
        known = self.known[name]
        state.add(name, known.R, known.p, known.covariance)
        self.landmarks[name] = Landmark.known(name, known)

    def _correct(
        self,
        state: FilterState,
        view: CameraView,
        there: list[tuple[Sighting, Landmark]],
        judged: ImageOutcome,
    ) -> FilterState:
        """By all that fit of those that may be used."""
        there = [one for one in there if one[1].is_used]
        pairs = [Pair(sight, landmark.key) for sight, landmark in there]
        good: list[Pair] = []
        compared = zip(pairs, there, fits(view, pairs, state), strict=True)
        for pair, (_, landmark), fit in compared:
            if fit.is_inlier:
                good.append(pair)
                landmark.seen += 1
                landmark.refused, landmark.last_ns = 0, view.stamp_ns
                judged.used.append(landmark.name)
            else:
                landmark.refused += 1
                why = f"is not where the map has it: {fit.distance2 / fit.size:.0f} times too far"
                judged.refuse(landmark.name, why, "was it moved?")
        if not good:
            return state
        state = update(state, view, good, [slice(0, CORE if self.is_frozen else None)])
        self._let_go_of_moved(state, judged)
        return state

    def _let_go_of_moved(self, state: FilterState, judged: ImageOutcome) -> None:
        """A landmark that others contradict, image after image, is not there any more."""
        if self.is_frozen:
            return
        for name in list(judged.refused):
            landmark = self.landmarks.get(name)
            if landmark and landmark.is_used and landmark.refused >= _MOVED:
                self._drop(state, landmark)
                self.known.pop(name, None)
                judged.refused[name] = "was moved: it begins anew"

    def _watch(
        self,
        state: FilterState,
        view: CameraView,
        sight: Sighting,
        landmark: Landmark,
        judged: ImageOutcome,
    ) -> FilterState:
        """A view of one that is not used yet."""
        state = landmark.watch(state, view, sight)
        if landmark.is_contradictory:
            self._drop(state, landmark)
            why = "is seen in several places"
            judged.refuse(landmark.name, why, "does it move, or is it of another size?")
            return state
        if landmark.may_be_used(self._rules.sightings, self._rules.reach):
            landmark.is_used = True
        judged.watched.append(landmark.name)
        return state

    def _begin(
        self, state: FilterState, view: CameraView, sights: list[Sighting], judged: ImageOutcome
    ) -> None:
        for sight in sights:
            is_new = sight.name not in self.landmarks and sight.name not in judged.refused
            if is_new and any(pose.R is not None for pose in sight.poses):
                self.landmarks[sight.name] = begin(state, view, sight)
                judged.watched.append(sight.name)

    def _begin_points(
        self, state: FilterState, view: CameraView, matches: list[PointMatch], judged: ImageOutcome
    ) -> None:
        """Points that are new, and why others are left out."""
        for sight, landmark, why in matches:
            if why:
                judged.refused[sight.name] = why
            if why or landmark or self._rules.plane is None:
                continue
            name = f"{sight.name}_{self._count + 1}"
            new = begin_point(state, view, sight, name, self._rules.plane)
            if new is not None:
                self._count += 1
                self.landmarks[name] = new
                judged.watched.append(name)

    def _drop(self, state: FilterState, landmark: Landmark) -> None:
        for key in landmark.keys:
            state.remove(key)
        del self.landmarks[landmark.name]

    def _thin_out(self, state: FilterState) -> None:
        """Let go of what was not seen for long: the map still has it."""
        several = sorted(self.landmarks.values(), key=lambda one: one.last_ns)
        for landmark in several[: max(len(several) - _MOST_CONSIDERED, 0)]:
            self._drop(state, landmark)
