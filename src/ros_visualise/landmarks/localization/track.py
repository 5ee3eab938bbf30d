"""One landmark over time: one estimate, or several while its views are ambiguous.

From afar, a small square looks the same in two poses. Both are followed, each as a branch, and each
is updated by the reading of every view that fits it better. The wrong one fits less and less as the
camera moves. It is dropped when the views are e^6 times as likely under the other branch.

A view that fits no branch is an outlier, or the landmark has moved: it begins one more branch, with
a small prior probability. So no single view decides, however far off it is: the evidence of all
views does, and meanwhile the covariance includes all branches. With these numbers the third view in
a row that contradicts the estimate replaces it, and after the fifth the former one is dropped.

Source: A. Wald, Sequential Analysis, 1947 (the likelihood ratio as a test over time).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from weakref import WeakSet

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry.se3 import turn_between
from ros_visualise.landmarks.localization.estimate import (
    CandidateUpdate,
    LandmarkEstimate,
    fit,
    vague,
)
from ros_visualise.landmarks.localization.seen import Ground, PoseReading

DECIDED = 6.0
"""Log-likelihood ratio of all views at which the less likely branch is dropped."""

_LOSS = 3.0  # largest log-likelihood ratio of one view: what outliers cost
_MOVED = 8.5  # the same of a landmark that has moved, a priori
_MOST = 4  # branches
_SAME = 1.0  # squared Mahalanobis distance at which branches are merged
_SURE = 0.3  # initial standard deviation along the ray, as a fraction of the range


@dataclass(frozen=True)
class Branch:
    """An estimate, and the log-likelihood of the views under it, relative to the best one when a
    view fitted that; ``is_elsewhere``: begun by a view that contradicted all others.
    """

    estimate: LandmarkEstimate
    evidence: float
    is_elsewhere: bool = False


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
    branches: tuple[Branch, ...]
    last_ns: int
    number: int = 0
    size_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    sizes: int = 0
    seen: int = 1
    apart: WeakSet[LandmarkTrack] = field(default_factory=WeakSet)

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
        top = self.branches[0].evidence
        likely = [math.exp(branch.evidence - top) for branch in self.branches]
        return [one / sum(likely) for one in likely]

    @property
    def covariance(self) -> Floats:
        """(6, 6) about the best estimate; includes the others while undecided."""
        whole = np.zeros((6, 6))
        for weight, branch in zip(self.weights, self.branches, strict=True):
            off = difference(branch.estimate, self.best)
            whole += weight * (branch.estimate.covariance + np.outer(off, off))
        return whole

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
            best, _ = max(several, key=lambda one: one[0].evidence + log_score(one[1]))
            found.append(best)
        return found

    def take(self, fits: Sequence[CandidateUpdate], stamp_ns: int) -> bool:
        """Update by a detection; at least one of the fits is an inlier. True if it has moved."""
        most = max(one.evidence for one in fits if one.is_inlier)
        found = [
            replace(
                branch,
                estimate=one.updated,
                evidence=branch.evidence + max(one.evidence - most, -_LOSS),
            )
            for branch, one in zip(self.branches, fits, strict=True)
        ]
        best, fitting = max(zip(found, fits, strict=True), key=lambda one: one[0].evidence)
        zero = best.evidence if fitting.is_inlier else 0.0
        self.seen += 1
        return self._settle((replace(b, evidence=b.evidence - zero) for b in found), stamp_ns)

    def contradict(self, elsewhere: Sequence[Branch], stamp_ns: int) -> bool:
        """Consider a detection that fits no branch. True if it has moved."""
        before = [replace(b, evidence=b.evidence - _LOSS) for b in self.branches]
        top = elsewhere[0].evidence
        new = [Branch(b.estimate, b.evidence - top - _MOVED, True) for b in elsewhere]
        return self._settle([*before, *new], stamp_ns)

    def _settle(self, branches: Iterable[Branch], stamp_ns: int) -> bool:
        self.branches = _decide(branches)
        self.last_ns = stamp_ns
        if not all(branch.is_elsewhere for branch in self.branches):
            return False
        self.branches = tuple(replace(b, is_elsewhere=False) for b in self.branches)
        return True

    def replace_by(self, other: LandmarkTrack) -> None:
        """Restart with the estimate of another track."""
        self.branches, self.seen, self.last_ns = other.branches, other.seen, other.last_ns
        self.size_xyz, self.sizes = other.size_xyz, other.sizes

    def measure(self, size_xyz: Floats | None) -> None:
        """Average in a measured size."""
        if size_xyz is not None:
            self.sizes += 1
            self.size_xyz = self.size_xyz + (size_xyz - self.size_xyz) / self.sizes


def begin(
    sightings: Sequence[PoseReading], robot: Floats, ground: Ground | None
) -> tuple[Branch, ...]:
    """The branches of a newly seen landmark; empty if it cannot be located.

    Args:
        sightings: the hypotheses of the detection.
        robot: (6, 6) covariance of the robot's error.
        ground: for objects seen without a range; None if unknown.
    """
    return _decide(
        Branch(estimate, evidence + log_score(one.score))
        for one in sightings
        for estimate, evidence in _begun(one, robot, ground)
    )


def difference(one: LandmarkEstimate, other: LandmarkEstimate) -> Floats:
    """(6,) error between two estimates."""
    turn = turn_between(one.R_fixed_landmark, other.R_fixed_landmark)
    return np.concatenate([one.position_xyz - other.position_xyz, turn])


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
        yield first.updated, first.evidence
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
        yield first.updated, first.evidence


def _decide(branches: Iterable[Branch]) -> tuple[Branch, ...]:
    """The branches that are still possible, the most likely first, without duplicates."""
    kept: list[Branch] = []
    for branch in sorted(branches, key=lambda one: -one.evidence):
        is_likely = not kept or branch.evidence > kept[0].evidence - DECIDED
        if is_likely and not any(_is_same(branch.estimate, one.estimate) for one in kept):
            kept.append(branch)
    return tuple(kept[:_MOST])


def _is_same(one: LandmarkEstimate, other: LandmarkEstimate) -> bool:
    off = difference(one, other)
    spread = one.covariance + other.covariance
    return bool(off @ np.linalg.solve(spread, off) < _SAME)
