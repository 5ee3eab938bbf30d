"""One landmark over time: one estimate, or two while its views have not decided which is right.

A small square seen from afar looks the same in two poses. Both are followed, each as a branch, and
each takes of every view the pose that fits it better. The wrong one fits less and less as the
camera moves; when the views are e^6 times as likely under another branch, it is dropped.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.localization.estimate import (
    CandidateUpdate,
    LandmarkEstimate,
    fit,
    vague,
)
from ros_visualise.landmarks.localization.seen import Ground, PoseReading, turn_between

DECIDED = 6.0
"""Log-likelihood ratio of all views from which on the less likely branch is dropped."""

_SAME = 1.0  # squared Mahalanobis distance of branches that have become one
_SURE = 0.3  # standard deviation along the ray, in parts of the range, to begin with


@dataclass(frozen=True)
class Branch:
    """An estimate, and the logarithm of how likely the views are under it."""

    estimate: LandmarkEstimate
    evidence: float


@dataclass(eq=False)
class LandmarkTrack:
    """What is known of one landmark.

    Attributes:
        class_id, class_number: its class, as `ros_visualise.data.Hypothesis` has it.
        number: what its localizer calls it by; 0 until it is confirmed.
        turned: whether it has an orientation: then it is the only one of its class.
        branches: the most likely first.
        size_xyz: (3,) metres, zero where nobody knows.
        seen: how many sightings are in it.
        last_ns: the time of the last.
        apart: those that were seen in the same image, so that they are others.
        rival: where it is seen, too, against all that is known: moved, or a second one.
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
    apart: set[LandmarkTrack] = field(default_factory=set)
    rival: LandmarkTrack | None = None

    @property
    def name(self) -> str:
        """What it is called: by its class, with its number where that may have several."""
        return self.class_id if self.turned else f"{self.class_id}_{self.number}"

    @property
    def best(self) -> LandmarkEstimate:
        """The more likely estimate."""
        return self.branches[0].estimate

    @property
    def weights(self) -> list[float]:
        """How probable each branch is."""
        top = self.branches[0].evidence
        likely = [math.exp(branch.evidence - top) for branch in self.branches]
        return [one / sum(likely) for one in likely]

    @property
    def covariance(self) -> Floats:
        """(6, 6) about the best estimate; while another branch may be right, that is in it."""
        whole = np.zeros((6, 6))
        for weight, branch in zip(self.weights, self.branches, strict=True):
            off = difference(branch.estimate, self.best)
            whole += weight * (branch.estimate.covariance + np.outer(off, off))
        return whole

    def carry(self, kept: Floats, covariance: Floats) -> None:
        """Go on to a time at which the robot's error is another; see `LandmarkEstimate.carried`."""
        carried = [b.estimate.carried(kept, covariance) for b in self.branches]
        pairs = zip(carried, self.branches, strict=True)
        self.branches = tuple(Branch(estimate, b.evidence) for estimate, b in pairs)
        if self.rival:
            self.rival.carry(kept, covariance)

    def fits(self, sightings: Sequence[PoseReading]) -> list[CandidateUpdate]:
        """For each branch how the hypothesis of a detection that fits it best does."""
        found = []
        for branch in self.branches:
            several = [(fit(branch.estimate, one.expect), one.score) for one in sightings]
            best, _ = max(several, key=lambda one: one[0].evidence + log_score(one[1]))
            found.append(best)
        return found

    def take(self, fits: Sequence[CandidateUpdate], stamp_ns: int) -> None:
        """Update it with a detection; at least one of the fits is an inlier."""
        self.branches = _decide(
            Branch(
                one.updated if one.is_inlier else branch.estimate, branch.evidence + one.evidence
            )
            for branch, one in zip(self.branches, fits, strict=True)
        )
        self.seen += 1
        self.last_ns = stamp_ns

    def replace_by(self, other: LandmarkTrack) -> None:
        """Begin anew with what another one knows."""
        self.branches, self.seen, self.last_ns = other.branches, other.seen, other.last_ns
        self.size_xyz, self.sizes, self.rival = other.size_xyz, other.sizes, None

    def measure(self, size_xyz: Floats | None) -> None:
        """Let a measured size count."""
        if size_xyz is not None:
            self.sizes += 1
            self.size_xyz = self.size_xyz + (size_xyz - self.size_xyz) / self.sizes


def begin(
    sightings: Sequence[PoseReading], robot: Floats, ground: Ground | None
) -> tuple[Branch, ...]:
    """The branches of a landmark that is seen for the first time; none if it cannot be placed.

    Args:
        sightings: the hypotheses of the detection.
        robot: (6, 6) covariance of the robot's error.
        ground: where a thing stands that is seen without a range; None where nobody knows.
    """
    return _decide(
        Branch(estimate, evidence + log_score(one.score))
        for one in sightings
        for estimate, evidence in _begun(one, robot, ground)
    )


def difference(one: LandmarkEstimate, other: LandmarkEstimate) -> Floats:
    """(6,) the error that one estimate is from another."""
    turn = turn_between(one.R_fixed_landmark, other.R_fixed_landmark)
    return np.concatenate([one.position_xyz - other.position_xyz, turn])


def log_score(score: float) -> float:
    """How the score of a hypothesis counts; where a detector gives none, not at all."""
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
    """Those that may still be right, the most likely first, each once."""
    kept: list[Branch] = []
    for branch in sorted(branches, key=lambda one: -one.evidence):
        is_likely = not kept or branch.evidence > kept[0].evidence - DECIDED
        if is_likely and not any(_is_same(branch.estimate, one.estimate) for one in kept):
            kept.append(branch)
    return tuple(kept)


def _is_same(one: LandmarkEstimate, other: LandmarkEstimate) -> bool:
    off = difference(one, other)
    spread = one.covariance + other.covariance
    return bool(off @ np.linalg.solve(spread, off) < _SAME)
