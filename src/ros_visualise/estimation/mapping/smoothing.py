"""Smoothing: the poses of camera and tags that fit all views best.

Source: W. Triggs and others, Bundle Adjustment - A Modern Synthesis, 2000.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.mapping.branches import turn_tags, turn_views
from ros_visualise.estimation.mapping.minimising import GATE, chi2_of, final, kept, minimise, robust
from ros_visualise.estimation.mapping.noise import (
    extra_of_corners,
    lasting_views,
    scales_of_odometry,
)
from ros_visualise.estimation.mapping.normal import Factor
from ros_visualise.estimation.mapping.problem import Flags, Poses, Problem
from ros_visualise.estimation.mapping.starting import anchor_of, begin, poses
from ros_visualise.estimation.mapping.terms import Terms
from ros_visualise.estimation.mapping.unknowns import (
    UNKNOWN,
    MeasurementNoise,
    SharedPrior,
    Unknowns,
)

_SCALES = (100.0, 10.0, 1.0, 0.3, 0.1)  # of the robust weights, from coarse to fine
_TURNS = 4
_SETTLED = 5
DECIDED = 12.0
"""Twice the log-likelihood ratio that decides between two poses."""


@dataclass(frozen=True, eq=False)
class SmoothedMap:
    """The result of smoothing.

    Attributes:
        problem: the connected part of the data.
        views, tags: the poses in the map.
        covariances: (M, 6, 6) of each tag: x, y, z and rotations about them, in the map.
        factor: of the equations, for the covariances between tags.
        shared, shared_covariance: (G,) and (G, G), see `unknowns`.
        inliers: (S,) mask of the sightings that fit.
        residuals_px: (S,) rms distance of a sighting's corners.
        noise: of corners and odometry.
        undecided: (M,) mask of tags with an ambiguous pose.
        is_estimated: True if the noise was estimated, not given.
    """

    problem: Problem
    views: Poses
    tags: Poses
    covariances: Floats
    factor: Factor
    shared: Floats
    shared_covariance: Floats
    inliers: Flags
    residuals_px: Floats
    noise: MeasurementNoise
    undecided: Flags
    is_estimated: bool

    def times(self, tags: list[int], weights: Floats) -> Floats:
        """(K, 6, C) the joint covariance of K tags times weights (K, 6, C)."""
        structure = self.factor.structure
        right = np.zeros((structure.size, 6, weights.shape[2]))
        blocks = structure.views + np.array(tags, int)
        right[blocks] = weights
        product: Floats = self.factor.solve(right)[blocks]
        return product


def smooth(
    problem: Problem, noise: MeasurementNoise | None = None, prior: SharedPrior = UNKNOWN
) -> SmoothedMap | None:
    """The poses that fit best; None if nothing is connected.

    Args:
        problem: the recorded data.
        noise: of measurements; None: estimate it from the residuals.
        prior: of the shared numbers.

    Raises:
        numpy.linalg.LinAlgError: the problem is underdetermined.
    """
    if not problem.sightings:
        return None
    problem = replace(problem, anchor=anchor_of(problem))
    begun = begin(problem)
    problem = problem.restricted(begun.views, begun.tags)
    if not problem.sightings:
        return None
    terms = Terms(problem, noise or MeasurementNoise(), prior)
    state = Unknowns(
        poses(begun.T_views[begun.views]),
        poses(begun.T_tags[begun.tags]),
        np.zeros(terms.layout.count),
    )
    for scale in _SCALES:
        if noise is None:
            _estimate_px(terms, state)
        state = minimise(terms, state, robust(9 * scale * GATE), 10)
    state, worse = _turned(terms, state, noise is None)
    state, inliers = _settled(terms, state, noise is None)
    undecided = worse < DECIDED * terms.noise.views
    return result_of(terms, state, inliers, undecided, noise is None)


def _estimate_px(terms: Terms, state: Unknowns) -> None:
    terms.with_noise(extra_px=extra_of_corners(terms, state))


def _turned(terms: Terms, state: Unknowns, estimated: bool) -> tuple[Unknowns, Floats]:
    """The state after flipping tags and views until no flip improves it."""
    worse = np.full(terms.problem.counts[1], np.inf)
    for _ in range(_TURNS):
        of_views = turn_views(terms, state)
        of_tags = turn_tags(terms, of_views.state)
        worse = of_tags.worse
        if not of_views.changed + of_tags.changed:
            break
        state = minimise(terms, of_tags.state, robust(9 * GATE), 10)
        if estimated:
            _estimate_px(terms, state)
    return state, worse


def _settled(terms: Terms, state: Unknowns, estimated: bool) -> tuple[Unknowns, Flags]:
    """The state fitted to inliers only, with noise matching the residuals."""
    inliers = np.zeros(len(terms.corners.views), bool)
    for _ in range(_SETTLED):
        if estimated:
            _estimate_px(terms, state)
            terms.with_noise(views=lasting_views(terms, state, inliers))
            terms.noise = scales_of_odometry(terms, state, inliers)
        before, inliers = inliers, chi2_of(terms, state) < GATE
        state = minimise(terms, state, kept(inliers), 10)
        if (before == inliers).all():
            break
    return state, inliers


def result_of(
    terms: Terms, state: Unknowns, inliers: Flags, undecided: Flags, is_estimated: bool
) -> SmoothedMap:
    """The result, with its covariance.

    Raises:
        numpy.linalg.LinAlgError: the problem is underdetermined.
    """
    factor = final(terms, state, inliers)
    covariance, structure = factor.inverse(), terms.structure
    residuals = terms.residuals_px(state)
    return SmoothedMap(
        terms.problem,
        state.views,
        state.tags,
        covariance.own[structure.views : structure.count],
        factor,
        state.shared,
        structure.shared_covariance(covariance),
        inliers,
        np.sqrt((residuals**2).sum(axis=1) / 4),
        terms.noise,
        undecided,
        is_estimated,
    )
