"""Alternative estimates of one thing, each with the evidence of all views for it.

A view that fits no branch is an outlier, or the thing has moved: it begins one more branch, with a
small prior probability. So no single view decides, however far off it is: the evidence of all
views does, and meanwhile the covariance includes all branches.

Source: A. Wald, Sequential Analysis, 1947 (the likelihood ratio as a test over time); Bar-Shalom,
Li and Kirubarajan, Estimation with applications to tracking and navigation, 2001, section 1.4.16
(the covariance of alternatives).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.gates import DECIDED
from ros_visualise.estimation.localization.estimate import CandidateUpdate, LandmarkEstimate

LOSS = 2.0
"""Largest log-likelihood ratio of one view: what an outlier costs."""

MOVED = 5.0
"""The same against a thing that has moved, a priori: the third view elsewhere decides."""

_BY_VIEW = 1.0  # of that, for each of the first views
_MOST = 4  # branches
_SAME = 1.0  # squared Mahalanobis distance at which branches are merged


@dataclass(frozen=True)
class Branch:
    """An estimate, and the log-likelihood of the views under it, relative to the best one when a
    view fitted that; ``is_elsewhere``: begun by a view that contradicted all others.
    """

    estimate: LandmarkEstimate
    evidence: float = 0.0
    is_elsewhere: bool = False


Branches = tuple[Branch, ...]
"""The most likely first."""


def take(branches: Branches, fits: Sequence[CandidateUpdate], loss: float = LOSS) -> Branches:
    """The branches updated by a view that fits at least one of them.

    Args:
        branches: those before.
        fits: of each branch.
        loss: largest one, of branches that it does not fit.
    """
    most = max(one.fit.evidence for one in fits if one.fit.is_inlier)
    found = [
        replace(
            branch,
            estimate=one.updated,
            evidence=branch.evidence + max(one.fit.evidence - most, -loss),
        )
        for branch, one in zip(branches, fits, strict=True)
    ]
    best, fitting = max(zip(found, fits, strict=True), key=lambda one: one[0].evidence)
    zero = best.evidence if fitting.fit.is_inlier else 0.0
    return decide(replace(branch, evidence=branch.evidence - zero) for branch in found)


def contradict(branches: Branches, elsewhere: Branches, seen: int, loss: float = LOSS) -> Branches:
    """The branches after a view that fits none of them.

    Args:
        branches: those before.
        elsewhere: what the view shows.
        seen: number of views before.
        loss: of those before.
    """
    before = [replace(one, evidence=one.evidence - loss) for one in branches]
    prior = min(MOVED, _BY_VIEW * seen)
    top = max((one.evidence for one in elsewhere), default=0.0)
    new = [Branch(one.estimate, one.evidence - top - prior, True) for one in elsewhere]
    return decide([*before, *new])


def decide(branches: Iterable[Branch]) -> Branches:
    """The branches that are still possible, the most likely first, without duplicates."""
    kept: list[Branch] = []
    for branch in sorted(branches, key=lambda one: -one.evidence):
        is_likely = not kept or branch.evidence > kept[0].evidence - DECIDED
        if is_likely and not any(_is_same(branch.estimate, one.estimate) for one in kept):
            kept.append(branch)
    return tuple(kept[:_MOST])


def settled(branches: Branches) -> tuple[Branches, bool]:
    """The same, and True if the best branch is elsewhere; the others are from then on."""
    if not branches[0].is_elsewhere:
        return branches, False
    return tuple(replace(b, is_elsewhere=b is not branches[0]) for b in branches), True


def weights(branches: Branches) -> list[float]:
    """Probability of each branch."""
    likely = [math.exp(branch.evidence - branches[0].evidence) for branch in branches]
    return [one / sum(likely) for one in likely]


def covariance(branches: Branches) -> Floats:
    """(9, 9) about the best estimate; includes the others while undecided."""
    best = branches[0].estimate
    whole = np.zeros_like(best.covariance)
    for weight, branch in zip(weights(branches), branches, strict=True):
        off = branch.estimate.minus(best)
        whole += weight * (branch.estimate.covariance + np.outer(off, off))
    return whole


def _is_same(one: LandmarkEstimate, other: LandmarkEstimate) -> bool:
    off = one.minus(other)
    spread = one.covariance + other.covariance
    return bool(off @ np.linalg.pinv(spread, hermitian=True) @ off < _SAME)
