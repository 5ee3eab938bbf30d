"""Levenberg-Marquardt over all poses, with gradually stricter outlier rejection."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.gates import GATES
from ros_visualise.estimation.mapping.normal import Factor, NormalEquations
from ros_visualise.estimation.mapping.priors import add_known
from ros_visualise.estimation.mapping.problem import Flags
from ros_visualise.estimation.mapping.terms import Terms
from ros_visualise.estimation.mapping.unknowns import Unknowns

Weigh = Callable[[Floats], tuple[Floats, Floats]]
"""Squared residuals (S,) -> weights (S,), and the contribution of each sighting to the sum."""

GATE = GATES[8]
"""Largest squared residual of the corners of a sighting that fits."""

_DAMPING, _MOST_DAMPING = 1e-5, 1e8
_CONVERGED = 1e-7  # smallest relative decrease of the sum


def robust(scale: float) -> Weigh:
    """Geman and McClure's weights: sightings that fit far worse than ``scale`` count little.

    Source: S. Geman, D. McClure, Statistical methods for tomographic image reconstruction, 1987.
    """

    def weigh(chi2: Floats) -> tuple[Floats, Floats]:
        share = scale / (scale + chi2)
        return share**2, scale * (1 - share)

    return weigh


def kept(inliers: Flags) -> Weigh:
    """Full weight for these sightings (S,), none for others."""

    def weigh(chi2: Floats) -> tuple[Floats, Floats]:
        return inliers.astype(float), np.where(inliers, chi2, 0.0)

    return weigh


def chi2_of(terms: Terms, state: Unknowns) -> Floats:
    """(S,) squared whitened residuals of the sightings; huge behind the camera."""
    residuals = terms.residuals_px(state) / terms.sigma_px()[:, None]
    return np.where(np.isfinite(residuals).all(axis=1), (residuals**2).sum(axis=1), 1e12)


def minimise(terms: Terms, state: Unknowns, weigh: Weigh, rounds: int = 30) -> Unknowns:
    """The state that minimises the sum of squares, from a nearby start.

    Raises:
        numpy.linalg.LinAlgError: the problem is underdetermined.
    """
    damping = _DAMPING
    normal, cost = linearised(terms, state, weigh)
    for _ in range(rounds):
        new = state.moved(*Factor(normal, damping).step())
        new_normal, new_cost = linearised(terms, new, weigh)
        if new_cost <= cost:
            gain, state, normal, cost = cost - new_cost, new, new_normal, new_cost
            damping = max(damping / 10, 1e-12)
            if gain <= _CONVERGED * cost:
                break
        else:
            damping *= 10
            if damping > _MOST_DAMPING:
                break
    return state


def linearised(terms: Terms, state: Unknowns, weigh: Weigh) -> tuple[NormalEquations, float]:
    """The normal equations at a state, and the sum to be minimised."""
    normal = NormalEquations(terms.structure)
    weights, losses = weigh(chi2_of(terms, state))
    terms.add_seen(normal, state, weights)
    of_odometry = terms.add_gone(normal, state)
    known = add_known(normal, state, terms.problem, terms.prior, terms.noise)
    seen = losses.sum() / terms.noise.views
    return normal, float(seen + (of_odometry**2).sum() + known)


def final(terms: Terms, state: Unknowns, inliers: Flags) -> Factor:
    """The equations at the minimum, whose inverse is the covariance."""
    return Factor(linearised(terms, state, kept(inliers))[0])
