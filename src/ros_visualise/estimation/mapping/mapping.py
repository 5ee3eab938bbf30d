"""From recorded data to a map: smooth, name outliers, correct them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.estimation.localization.common_error import split_by
from ros_visualise.estimation.localization.track import LandmarkTrack
from ros_visualise.estimation.mapping.minimising import kept, minimise
from ros_visualise.estimation.mapping.mounting import (
    Gyro,
    MountingCheck,
    camera_mounting,
    freely_mounted,
    imu_mounting,
)
from ros_visualise.estimation.mapping.noise import scales_of_survey
from ros_visualise.estimation.mapping.normal import Numbers
from ros_visualise.estimation.mapping.outliers import (
    HANGING,
    MOVED,
    SURVEY,
    TWICE,
    UNSTEADY,
    Outlier,
    corrected,
    other_size,
    outliers,
    resized,
    wrong_survey,
)
from ros_visualise.estimation.mapping.places import separated
from ros_visualise.estimation.mapping.problem import Problem
from ros_visualise.estimation.mapping.rig import rig_as_found
from ros_visualise.estimation.mapping.smoothing import SmoothedMap, result_of, smooth
from ros_visualise.estimation.mapping.terms import Terms
from ros_visualise.estimation.mapping.unknowns import SharedPrior, Unknowns
from ros_visualise.geometry.se3 import about_itself, about_origin, from_parts, inverse

_ROUNDS, _SURVEY_ROUNDS = 6, 4
_PRINTED = 0.01  # prior of the common scale error of tag sizes, with a survey
_LEAST_SEEN = 3  # sightings that make a landmark


@dataclass(frozen=True, eq=False)
class TagMap:
    """The smoothed map, outliers, the tags as landmarks, and the mounting of cameras.

    ``common`` (6, 6) is the covariance of the landmarks' common error, which is included in each of
    theirs.
    """

    smoothed: SmoothedMap
    outliers: Sequence[Outlier]
    tracks: Sequence[LandmarkTrack]
    common: Floats
    mountings: Sequence[MountingCheck]

    def correction(self, stamp_ns: int) -> Floats:
        """T_map_fixed (4, 4): the error of tf about the camera at a time."""
        problem = self.smoothed.problem
        if problem.odometry is None:
            return np.eye(4)
        view = int(np.abs(problem.stamps_ns - stamp_ns).argmin())
        smoothed = from_parts(self.smoothed.views.R[view], self.smoothed.views.t[view])
        return smoothed @ inverse(problem.odometry.T_fixed_camera[view])


def map_of(
    problem: Problem, gyro: Callable[[npt.NDArray[np.int64]], Gyro | None] | None = None
) -> TagMap | None:
    """A map of the tags of a recording; None if nothing is connected.

    Args:
        gyro: gives the IMU measurements for the stamps of views.

    Raises:
        numpy.linalg.LinAlgError: the problem is underdetermined.
    """
    is_measured = bool(problem.surveyed or problem.distances)
    prior = SharedPrior(printed=_PRINTED if is_measured else 0.0)
    problem, explained = separated(problem)
    found = smooth(problem, prior=prior)
    if found is None:
        return None
    found = rig_as_found(found, prior)
    mountings = []
    if problem.odometry is not None:
        mounting, freed = camera_mounting(found)
        mountings.append(mounting)
        if mounting.is_wrong:  # or tags would be blamed for it
            found, prior = freed, freely_mounted(prior)
    for _ in range(_ROUNDS):
        new = (
            wrong_survey(found)
            or [one for one in outliers(found) if one.kind != UNSTEADY]
            or other_size(problem, found)
        )
        if not new:
            break
        explained += [one for one in new if one.kind in (MOVED, TWICE, SURVEY)]
        again = smooth(corrected(found.problem, new), prior=prior)
        found = again or found
    found = surveyed_as_found(found, prior)
    rest = [one for one in outliers(found) if one.kind == UNSTEADY]
    explained += unconnected(found)
    measured = gyro(found.problem.stamps_ns) if gyro else None
    of_imu = imu_mounting(found, measured) if measured else None
    mountings += [of_imu] if of_imu else []
    explained += resized(problem, found)
    hanging = {one.name for one in explained if one.kind == HANGING}
    return TagMap(found, [*explained, *rest], *landmarks_of(found, hanging), mountings)


def surveyed_as_found(found: SmoothedMap, prior: SharedPrior) -> SmoothedMap:
    """The map with a survey that counts as much as it is found to deviate, not as given."""
    terms = Terms(found.problem, found.noise, prior)
    state = Unknowns(found.views, found.tags, found.shared)
    for _ in range(_SURVEY_ROUNDS):
        before, terms.noise = terms.noise, scales_of_survey(terms, state, found.inliers)
        if terms.noise == before:
            break
        state = minimise(terms, state, kept(found.inliers), 10)
    if terms.noise == found.noise:
        return found
    return result_of(terms, state, found.inliers, found.undecided, found.is_estimated)


def landmarks_of(
    found: SmoothedMap, omitted: Collection[str] = ()
) -> tuple[list[LandmarkTrack], Floats]:
    """Tags as localized landmarks, except those that most views contradict.

    Also the covariance (6, 6) of their common error.
    """
    names = found.problem.names
    kept = {
        tag: rows
        for tag, rows in _kept(found).items()
        if names[tag] not in omitted and " " not in names[tag]
    }
    tags = list(kept)
    change = np.array([about_origin(at) for at in found.tags.t[tags]]).reshape(-1, 6, 6)
    twists = change @ found.covariances[tags] @ np.swapaxes(change, 1, 2)

    def times(weights: Floats) -> Floats:
        return change @ found.times(tags, np.swapaxes(change, 1, 2) @ weights)

    common, own = split_by(twists, times)
    tracks = []
    for (tag, rows), of_twist in zip(kept.items(), own + common, strict=True):
        back = about_itself(found.tags.t[tag])
        covariance = back @ of_twist @ back.T
        tracks.append(_track(found, tag, rows, (covariance + covariance.T) / 2))
    return tracks, common


def unconnected(found: SmoothedMap) -> list[Outlier]:
    """Tags that no fitting sightings of other good tags connect with the start of the map.

    Their covariance would be that of the sightings alone, as if what they hang by were right.
    """
    problem, kept = found.problem, _kept(found)  # and other places of tags
    if problem.odometry is not None:
        return []
    reached = {one.tag for one in problem.surveyed if one.tag in kept} or {problem.anchor}
    tags_of: dict[int, set[int]] = defaultdict(set)
    for tag, rows in kept.items():
        for row in rows:
            tags_of[problem.sightings[row].view].add(tag)
    groups = [*tags_of.values()]
    before = -1
    while len(reached) > before:
        before = len(reached)
        reached = reached.union(*(group for group in groups if group & reached))
    text = "no consistent sightings connect it to the rest of the map; omitted"
    return [
        Outlier(problem.names[tag], HANGING, text)
        for tag in kept
        if tag not in reached and " " not in problem.names[tag]
    ]


def _kept(found: SmoothedMap) -> dict[int, Numbers]:
    """The tags that most of their views confirm, and their inlier sightings."""
    numbers = np.array([one.tag for one in found.problem.sightings], int)
    kept = {}
    for tag in range(len(found.problem.names)):
        rows = np.flatnonzero((numbers == tag) & found.inliers)
        if len(rows) >= max(_LEAST_SEEN, (numbers == tag).sum() / 2):
            kept[tag] = rows
    return kept


def _track(found: SmoothedMap, tag: int, rows: Numbers, covariance: Floats) -> LandmarkTrack:
    sightings = [found.problem.sightings[row] for row in rows]
    name, size = found.problem.names[tag], sightings[0].size_m
    pose = found.tags.t[tag], found.tags.R[tag], covariance
    last_ns = int(found.problem.stamps_ns[[one.view for one in sightings]].max())
    square = np.array([size, size, 0.0])
    return LandmarkTrack.of_map((name, _number(name)), pose, square, len(rows), last_ns=last_ns)


def _number(name: str) -> int:
    tail = name.rpartition("_")[2]
    return int(tail) if tail.isdecimal() else -1
