"""Fusion of the detections of many images into landmarks in a fixed frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations, count

import numpy as np

from ros_visualise.data import Detection, Detections, Floats
from ros_visualise.estimation.localization.estimate import ROBOT, CandidateUpdate
from ros_visualise.estimation.localization.robot_error import ErrorModel, RobotError
from ros_visualise.estimation.localization.seen import Ground, PoseReading, sighting_of
from ros_visualise.estimation.localization.sizes import SizeMeasurement
from ros_visualise.estimation.localization.track import LandmarkTrack, begin
from ros_visualise.landmarks.once_log import OnceLog

ELLIPSOID = 7.815
"""95 % point of the chi-square distribution with 3 degrees of freedom."""

_FORGOTTEN_S = 10.0  # how long an unconfirmed landmark waits for more sightings
_LEAST = 1e-12  # smallest variance of the robot's error, to avoid division by zero


@dataclass(frozen=True)
class LocalizerRules:
    """Rules for new landmarks.

    ``sightings`` is the number that confirms a landmark. ``ground`` is where objects without a
    range stand; None if unknown. ``prefix`` is put before classes that are numbers. ``moving`` are
    classes ignored because they move.
    """

    sightings: int = 3
    errors: ErrorModel = field(default_factory=ErrorModel)
    ground: Ground | None = None
    prefix: str = ""
    moving: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class _Located:
    """A detection, and the reading of each of its hypotheses, at least one."""

    detection: Detection
    class_id: str
    sightings: Sequence[PoseReading]

    @property
    def turned(self) -> bool:
        """True if it has an orientation."""
        return self.sightings[0].R_fixed_landmark is not None


class Localizer:
    """The landmarks of one fixed frame.

    Objects with an orientation, such as tags, are unique in their class. Of others there may be
    many, and a detection goes to the landmark of its class that fits best, if any does.

    Attributes:
        landmarks: the confirmed ones, by number.
        skipped: number of unused detections, by reason.
        has_changed: True if the last image changed any landmark.

    Args:
        known: initial landmarks.
    """

    def __init__(self, known: Iterable[LandmarkTrack] = ()) -> None:
        self.landmarks: dict[int, LandmarkTrack] = {}
        self.skipped: Counter[str] = Counter()
        self.has_changed = False
        self._tentative: list[LandmarkTrack] = []
        self._robot = RobotError()
        self._numbers = count(1)
        self._log = OnceLog("landmark_localizer")
        for track in known:
            self._confirm(track)

    def observe(
        self,
        detections: Detections,
        T_fixed_camera: Floats,
        rules: LocalizerRules,
        robot_covariance: Floats | None = None,
    ) -> None:
        """Process the detections of one image.

        Args:
            detections: with poses in the camera's optical frame.
            T_fixed_camera: (4, 4) pose of the camera according to tf.
            rules: for new landmarks.
            robot_covariance: (6, 6) of the robot's error, as reported by an odometry; None: use
                ``rules.errors``.
        """
        stamp_ns, camera = detections.header.stamp_ns, T_fixed_camera[:3, 3]
        kept = self._robot.advance(stamp_ns, camera, rules.errors, robot_covariance)
        self._forget(stamp_ns)
        for track in self._tracks:
            track.carry(kept, self._robot.covariance)
        measure = SizeMeasurement(detections.camera_info, T_fixed_camera)
        rest = list(self._located(detections, T_fixed_camera, rules))
        matched = self._match(rest)
        for one, track, fits in matched:
            self._tell_if_moved(track, track.take(fits, stamp_ns))
            track.measure(measure.size(one.detection, track.best, track.turned))
            rest.remove(one)
        there = [track for _, track, _ in matched]
        for one in rest:
            self._begin(one, there, stamp_ns, rules)
        for one_of, other in combinations(there, 2):
            one_of.apart.add(other)
            other.apart.add(one_of)
        self._settle(rules.sightings)
        self.has_changed = bool(there)

    @property
    def _tracks(self) -> list[LandmarkTrack]:
        return [*self.landmarks.values(), *self._tentative]

    def _forget(self, stamp_ns: int) -> None:
        oldest_ns = stamp_ns - _FORGOTTEN_S * 1e9
        self._tentative = [one for one in self._tentative if one.last_ns >= oldest_ns]

    def _located(
        self, detections: Detections, T_fixed_camera: Floats, rules: LocalizerRules
    ) -> Iterator[_Located]:
        for detection in detections.detections:
            if rules.moving & {one.class_id for one in detection.hypotheses}:
                self.skipped["moves"] += 1
                continue
            sightings = [
                sighting
                for hypothesis in detection.hypotheses
                if hypothesis.class_id == detection.hypotheses[0].class_id
                and (sighting := sighting_of(hypothesis, T_fixed_camera)) is not None
            ]
            if sightings:
                class_id = detection.hypotheses[0].class_id
                name = rules.prefix + class_id if class_id.isdigit() else class_id
                yield _Located(detection, name, sightings)
            else:
                self.skipped["no pose"] += 1

    def _match(
        self, rest: Sequence[_Located]
    ) -> list[tuple[_Located, LandmarkTrack, list[CandidateUpdate]]]:
        """Pairs of detections and their landmarks, the best first."""
        pairs = []
        for one in rest:
            for track in self._tracks:
                if (track.class_id, track.turned) == (one.class_id, one.turned):
                    fits = track.fits(one.sightings)
                    if inliers := [new.fit.distance2 for new in fits if new.fit.is_inlier]:
                        pairs.append((min(inliers), one, track, fits))
        found: list[tuple[_Located, LandmarkTrack, list[CandidateUpdate]]] = []
        for _, one, track, fits in sorted(pairs, key=lambda pair: pair[0]):
            if not any(one is taken or track is full for taken, full, _ in found):
                found.append((one, track, fits))
        return found

    def _begin(
        self, one: _Located, there: list[LandmarkTrack], stamp_ns: int, rules: LocalizerRules
    ) -> None:
        """Start a landmark if none fits."""
        found = begin(one.sightings, self._robot.covariance, rules.ground)
        if not found:
            self.skipped["not on the ground"] += 1
            return
        number = one.detection.hypotheses[0].number
        new = LandmarkTrack(one.class_id, number, one.turned, found, stamp_ns)
        same = [t for t in self._tracks if t.turned and t.class_id == one.class_id]
        if one.turned and same:
            self._contest(same[0], new, there)
            return
        self._tentative.append(new)
        there.append(new)

    def _contest(
        self, track: LandmarkTrack, new: LandmarkTrack, there: list[LandmarkTrack]
    ) -> None:
        """Handle a tag seen where it cannot be."""
        if track in there:
            self.skipped["duplicate in the image"] += 1
            self._log.say(f"two copies of {track.name}; following one")
            return
        self.skipped["elsewhere"] += 1
        self._tell_if_moved(track, track.contradict(new.branches, new.last_ns))
        there.append(track)

    def _settle(self, sightings: int) -> None:
        """Confirm tracks seen often enough, and merge duplicates."""
        for track in [one for one in self._tentative if one.seen >= sightings]:
            self._tentative.remove(track)
            self._confirm(track)
        for older, newer in combinations(list(self.landmarks.values()), 2):
            is_there = newer.number in self.landmarks and older.number in self.landmarks
            if is_there and self._are_one(older, newer):
                self._merge(older, newer)

    def _confirm(self, track: LandmarkTrack) -> None:
        track.number = next(self._numbers)
        self.landmarks[track.number] = track

    def _are_one(self, a: LandmarkTrack, b: LandmarkTrack) -> bool:
        if a.turned or b.turned or a.class_id != b.class_id or b in a.apart:
            return False
        shared = self._robot.covariance + _LEAST * np.eye(6)
        of_a, of_b = a.best.joint[:3, ROBOT], b.best.joint[:3, ROBOT]
        both = of_a @ np.linalg.solve(shared, of_b.T)
        spread = a.best.covariance[:3, :3] + b.best.covariance[:3, :3] - both - both.T
        off = a.best.position_xyz - b.best.position_xyz
        return bool(off @ np.linalg.solve(spread, off) < ELLIPSOID)

    def _merge(self, older: LandmarkTrack, newer: LandmarkTrack) -> None:
        """Keep the more certain of two estimates; their correlation is unknown."""
        seen = older.seen + newer.seen
        if np.trace(newer.best.covariance[:3, :3]) < np.trace(older.best.covariance[:3, :3]):
            older.replace_by(newer)
        older.seen = seen
        older.last_ns = max(older.last_ns, newer.last_ns)
        older.apart |= newer.apart
        for track in newer.apart:
            track.apart.add(older)
        del self.landmarks[newer.number]

    def _tell_if_moved(self, track: LandmarkTrack, has_moved: bool) -> None:
        if has_moved and track.number:
            self._log.say(f"{track.name} moved; following it from its new position")
