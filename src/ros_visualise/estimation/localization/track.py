"""One landmark over time: one estimate, or several while its views are ambiguous.

From afar, a small square looks the same in two poses. Both are followed, each as a branch, and each
is updated by the reading of every view that fits it better. The wrong one fits less and less as the
camera moves. It is dropped when the views are e^6 times as likely under the other branch. So is
the former place of a tag that has moved: with the sixth view that contradicts it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from weakref import WeakSet

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.localization import branches
from ros_visualise.estimation.localization.branches import Branch, Branches
from ros_visualise.estimation.localization.estimate import (
    POSE,
    CandidateUpdate,
    LandmarkEstimate,
    fit,
    known,
    vague,
)
from ros_visualise.estimation.localization.seen import Ground, PoseReading

__all__ = ["Branch", "LandmarkTrack", "begin", "log_score"]

_SURE = 0.3  # initial standard deviation along the ray, as a fraction of the range


@dataclass(eq=False)
class LandmarkTrack:
    """One landmark.

    Attributes:
        class_id, class_number: its class, see `ros_visualise.data.Hypothesis`.
        number: assigned by its localizer; 0 until confirmed.
        turned: True if it has an orientation; then its class is unique.
        branches: the most likely first.
        size_xyz: (3,) metres, zero if unknown.
        seen: number of sightings.
        last_ns: time of the last.
        apart: tracks seen in the same image, therefore different landmarks.
    """

    class_id: str
    class_number: int
    turned: bool
    branches: Branches
    last_ns: int
    number: int = 0
    size_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    sizes: int = 0
    seen: int = 1
    apart: WeakSet[LandmarkTrack] = field(default_factory=WeakSet)

    @classmethod
    def of_map(
        cls,
        of_class: tuple[str, int],
        pose: tuple[Floats, Floats, Floats],
        size_xyz: Floats,
        seen: int,
        turned: bool = True,
        last_ns: int = 0,
        number: int = 0,
    ) -> LandmarkTrack:
        """A landmark of a map: its class, position, rotation and covariance (6, 6)."""
        first = (Branch(known(*pose)),)
        sizes = seen if size_xyz.any() else 0
        return cls(*of_class, turned, first, last_ns, number, size_xyz, sizes, seen)

    @property
    def name(self) -> str:
        """Its class, with its number if there may be several."""
        return self.class_id if self.turned else f"{self.class_id}_{self.number}"

    @property
    def best(self) -> LandmarkEstimate:
        """The more likely estimate."""
        return self.branches[0].estimate

    @property
    def weights(self) -> list[float]:
        """Probability of each branch."""
        return branches.weights(self.branches)

    @property
    def covariance(self) -> Floats:
        """(6, 6) about the best estimate; includes the others while undecided."""
        covariance: Floats = branches.covariance(self.branches)[POSE, POSE]
        return covariance

    def carry(self, kept: Floats, covariance: Floats) -> None:
        """Propagate to a new robot error; see `LandmarkEstimate.propagated`."""
        self.branches = tuple(
            replace(b, estimate=b.estimate.propagated(kept, covariance)) for b in self.branches
        )

    def fits(self, sightings: Sequence[PoseReading]) -> list[CandidateUpdate]:
        """For each branch, the update by the hypothesis of a detection that fits best."""
        found = []
        for branch in self.branches:
            several = [(fit(branch.estimate, one.expect), one.score) for one in sightings]
            best, _ = max(several, key=lambda one: one[0].fit.evidence + log_score(one[1]))
            found.append(best)
        return found

    def take(self, fits: Sequence[CandidateUpdate], stamp_ns: int) -> bool:
        """Update by a detection; at least one of the fits is an inlier. True if it has moved."""
        self.seen += 1
        return self._settle(branches.take(self.branches, fits), stamp_ns)

    def contradict(self, elsewhere: Branches, stamp_ns: int) -> bool:
        """Consider a detection that fits no branch. True if it has moved."""
        return self._settle(branches.contradict(self.branches, elsewhere, self.seen), stamp_ns)

    def _settle(self, found: Branches, stamp_ns: int) -> bool:
        self.branches, has_moved = branches.settled(found)
        self.last_ns = stamp_ns
        return has_moved

    def replace_by(self, other: LandmarkTrack) -> None:
        """Restart with the estimate of another track."""
        self.branches, self.seen, self.last_ns = other.branches, other.seen, other.last_ns
        self.size_xyz, self.sizes = other.size_xyz, other.sizes

    def measure(self, size_xyz: Floats | None) -> None:
        """Average in a measured size."""
        if size_xyz is not None:
            self.sizes += 1
            self.size_xyz = self.size_xyz + (size_xyz - self.size_xyz) / self.sizes


def begin(sightings: Sequence[PoseReading], robot: Floats, ground: Ground | None) -> Branches:
    """The branches of a newly seen landmark; empty if it cannot be located.

    Args:
        sightings: the hypotheses of the detection.
        robot: (6, 6) covariance of the robot's error.
        ground: for objects seen without a range; None if unknown.
    """
    return branches.decide(
        Branch(estimate, evidence + log_score(one.score))
        for one in sightings
        for estimate, evidence in _begun(one, robot, ground)
    )


def log_score(score: float) -> float:
    """Log of a hypothesis's score; 0 if the detector gives none."""
    return math.log(min(max(score, 1e-6), 1.0))


def _begun(
    sighting: PoseReading, robot: Floats, ground: Ground | None
) -> Iterator[tuple[LandmarkEstimate, float]]:
    """The estimate from one hypothesis, and its evidence."""
    R = np.eye(3) if sighting.R_fixed_landmark is None else sighting.R_fixed_landmark
    if sighting.has_range:
        first = fit(vague(sighting.position_xyz, R, robot), sighting.expect)
        yield first.updated, first.fit.evidence
        return
    met = ground.meet(sighting) if ground else None
    if ground is None or met is None:
        return
    standing = fit(vague(met, R, robot), ground.expect).updated
    first = fit(standing, sighting.expect)
    away = first.updated.position_xyz - sighting.camera_xyz
    range_m = float(np.linalg.norm(away))
    ray = away / range_m
    if ray @ first.updated.covariance[:3, :3] @ ray < (_SURE * range_m) ** 2:
        yield first.updated, first.fit.evidence
