"""Correcting a trajectory where the camera comes back to a place that it has seen before."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ros_visualise.core.printing import counted
from ros_visualise.estimation.visual.closing import close_way, edge_errors
from ros_visualise.estimation.visual.corrected import corrected_poses, without_scale
from ros_visualise.estimation.visual.odometry import VisualOdometry
from ros_visualise.estimation.visual.revisits import Closure, RevisitFinder
from ros_visualise.estimation.visual.stretch import VisualPose

_APART_S = 2.0  # between closures of one return


class Return(NamedTuple):
    """A time in which places were seen again.

    Attributes:
        start_s, end_s, before_s: seconds since the first image: of the return, and of when its
            places were seen first.
        closures: number of pairs of keyframes.
        points: number of points that agree, in the worst pair.
    """

    start_s: float
    end_s: float
    before_s: float
    closures: int
    points: int


class PlacesReport(NamedTuple):
    """Places that were known again.

    Attributes:
        moved: largest correction of a pose, in the trajectory's unit.
        rejected: closures that the odometry contradicts.
        ambiguous: keyframes that look like several places.
    """

    returns: list[Return]
    moved: float
    rejected: int
    ambiguous: int

    def as_dict(self) -> dict[str, Any]:
        """The same, for JSON."""
        return {**self._asdict(), "returns": [one._asdict() for one in self.returns]}

    def lines(self, unit: str) -> list[str]:
        """The same, for people."""
        found = [
            f"closed:    {one.start_s:.1f} to {one.end_s:.1f} s,"
            f" at places first seen at {one.before_s:.1f} s"
            f" ({counted(one.closures, 'keyframe')}, {one.points} or more points each)"
            for one in self.returns
        ]
        if found:
            found.append(f"moved:     by up to {self.moved:.3f}{unit}")
        for count, why in (
            (self.rejected, "contradicted by the odometry"),
            (self.ambiguous, "similar to several places"),
        ):
            if count:
                found.append(f"rejected:  {counted(count, 'closure')} ({why})")
        return found


class PlaceRecorder:
    """Collects the keyframes of an odometry, and corrects its poses at the end."""

    def __init__(self) -> None:
        self._finder: RevisitFinder | None = None
        self._last_ns = -1
        self._scale_sigma = 0.0

    def look(self, odometry: VisualOdometry) -> None:
        """Take the newest keyframe, if it is new."""
        newest = odometry.newest
        if newest is None or newest.stamp_ns == self._last_ns:
            return
        self._last_ns = newest.stamp_ns
        settings = odometry.settings
        self._scale_sigma = settings.height_sigma * bool(settings.height)
        self._finder = self._finder or RevisitFinder(odometry.camera)
        self._finder.add(newest.stamp_ns, odometry.counts["losses"], newest.gray)

    def correct(
        self, poses: list[VisualPose], first_ns: int
    ) -> tuple[list[VisualPose], PlacesReport]:
        """Corrected poses, in the order of their stamps, and a report on the recognized places."""
        finder = self._finder
        if finder is None:
            return poses, PlacesReport([], 0.0, 0, 0)
        one_scale = without_scale(poses, self._scale_sigma)
        by_stamp = {one.stamp_ns: one for one in one_scale}
        places = [one for one in finder.places if one.stamp_ns in by_stamp]
        finder.places = places
        for one in places:
            one.R, one.p = by_stamp[one.stamp_ns].R, by_stamp[one.stamp_ns].p
        closures = finder.find() if len(places) > 1 else []
        if not closures:
            return poses, PlacesReport([], 0.0, 0, finder.ambiguous)
        covariances = np.array([by_stamp[one.stamp_ns].covariance for one in places])
        way = close_way(places, edge_errors(places, covariances), closures)
        stamps_ns = [one.stamp_ns for one in places]
        corrected = poses
        if way.used:
            corrected = corrected_poses(one_scale, places, way, self._scale_sigma)
        moved = max(float(np.linalg.norm(a.p - b.p)) for a, b in zip(poses, corrected, strict=True))
        returns = _returns(way.used, [(stamp_ns - first_ns) / 1e9 for stamp_ns in stamps_ns])
        return corrected, PlacesReport(returns, moved, len(way.rejected), finder.ambiguous)


def _returns(used: list[Closure], times_s: list[float]) -> list[Return]:
    """Closures that follow each other, as one return."""
    ordered = sorted(used, key=lambda one: one.second)
    starts = [0, *(n for n, (a, b) in enumerate(pairwise(ordered), 1)
                   if times_s[b.second] - times_s[a.second] > _APART_S), len(ordered)]  # fmt: skip
    found = []
    for start, end in pairwise(starts):
        some = ordered[start:end]
        if some:
            seconds = [times_s[one.second] for one in some]
            before = float(np.median([times_s[one.first] for one in some]))
            points = min(one.inliers for one in some)
            found.append(Return(seconds[0], seconds[-1], before, len(some), points))
    return found
