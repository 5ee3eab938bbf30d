"""Noise of corners and odometry, estimated from the residuals of the best fit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.mapping.minimising import final
from ros_visualise.estimation.mapping.priors import from_survey
from ros_visualise.estimation.mapping.problem import Flags, Problem
from ros_visualise.estimation.mapping.terms import Terms
from ros_visualise.estimation.mapping.unknowns import MeasurementNoise, Unknowns

_MOST_PX = 100.0
PASS_NS = 5_000_000_000
"""Out of sight for so long, a tag is passed again."""
_LEAST_VIEWS, _LEAST_SIGHTINGS = 10, 20  # needed to estimate the noise of odometry, of a camera
_LEAST_SURVEYED, _MOST_SURVEY = 5, 10.0  # tags; largest factor


def extra_of_corners(terms: Terms, state: Unknowns) -> tuple[float, ...]:
    """Additional noise of the corners of each camera, in pixels.

    It makes the median of the squared residuals equal to its expectation. Each sighting has eight
    numbers; the unknowns are distributed evenly over all sightings.
    """
    residuals = (terms.residuals_px(state) ** 2).sum(axis=1)
    left = _left(terms.problem)
    median = left * (1 - 2 / (9 * left)) ** 3  # of chi-square (Wilson and Hilferty)
    found = []
    for camera in range(len(terms.problem.cameras)):
        own = terms.corners.cameras == camera
        own |= own.sum() < _LEAST_SIGHTINGS  # too few: as all cameras
        found.append(_extra(residuals[own], terms.corners.sigma_px[own], median))
    return tuple(found)


def _extra(residuals: Floats, sigma_px: Floats, median: float) -> float:
    """Additional noise that makes the median of residuals (S,), squared and whitened, this."""
    low, high = 0.0, _MOST_PX
    for _ in range(40):
        extra = (low + high) / 2
        chi2 = residuals / (sigma_px**2 + extra**2)
        if np.median(np.where(np.isfinite(chi2), chi2, np.inf)) > median:
            low = extra
        else:
            high = extra
    return high


def lasting_views(terms: Terms, state: Unknowns, inliers: Flags) -> float:
    """Number of views of a tag that count as one, at least 1.

    Errors of corners last from view to view: a tag is not quite flat, its edges fall on pixels in
    the same way while the camera moves little. The sum over the views of a tag that follow one
    another then has a larger variance than independent errors would have.

    Source: N. Newey, K. West, A simple, positive semi-definite, heteroskedasticity and
    autocorrelation consistent covariance matrix, 1987; here without weights, over all of a pass.
    """
    rows = np.flatnonzero(inliers)
    if not len(rows):
        return 1.0
    residuals = terms.residuals_px(state)[rows] / terms.sigma_px()[rows, None]
    tags, stamps = terms.corners.tags[rows], terms.problem.stamps_ns[terms.corners.views[rows]]
    passes = tags * len(terms.problem.cameras) + terms.corners.cameras[rows]
    order = np.lexsort((stamps, passes))
    begins = np.diff(passes[order], prepend=-1) != 0
    begins[1:] |= np.diff(stamps[order]) > PASS_NS
    sums = np.add.reduceat(residuals[order], np.flatnonzero(begins))
    return max(1.0, float((sums**2).sum() / (residuals**2).sum()))


def _left(problem: Problem) -> float:
    """Redundant numbers per sighting."""
    views, tags = problem.counts
    known = 6 * max(views - 1, 0) if problem.odometry is not None else 0
    unknown = 6 * (views + tags) - known
    return max(8 - unknown / len(problem.sightings), 1.0)


def scales_of_survey(terms: Terms, state: Unknowns, inliers: Flags) -> MeasurementNoise:
    """Factors by which the survey deviates more than given, at least 1.

    Separately for positions and orientations, by the redundancy of each; see `scales_of_odometry`.
    """
    surveyed = terms.problem.surveyed
    if len(surveyed) < _LEAST_SURVEYED:
        return terms.noise
    own = final(terms, state, inliers).inverse().own[terms.structure.views :]
    before = np.array([terms.noise.survey_position, terms.noise.survey_turn])
    larger = np.repeat(before, 3)
    off = np.array([from_survey(state, one) for one in surveyed]) / larger
    given = np.array([np.concatenate([one.position_sigma, one.R_sigma]) for one in surveyed])
    left = 1 - np.diagonal(own[[one.tag for one in surveyed]], 0, 1, 2) / (given * larger) ** 2
    left[[one.R is None for one in surveyed], 3:] = 0
    redundancy = np.maximum(left, 0).sum(axis=0).reshape(2, 3).sum(axis=1)
    square = (off**2).sum(axis=0).reshape(2, 3).sum(axis=1) / np.maximum(redundancy, 1)
    factors = np.clip(before * np.sqrt(square), 1, _MOST_SURVEY)
    return replace(terms.noise, survey_position=float(factors[0]), survey_turn=float(factors[1]))


def scales_of_odometry(terms: Terms, state: Unknowns, inliers: Flags) -> MeasurementNoise:
    """Noise of odometry that makes its residuals as large as expected.

    Separately for distances, tilts and headings, by the redundancy of each.

    Source: W. Foerstner, Ein Verfahren zur Schaetzung von Varianz- und Kovarianzkomponenten, 1979.
    """
    residuals = terms.gone(state)[0]
    if len(residuals) < _LEAST_VIEWS or not inliers.any():
        return terms.noise
    explained = terms.explained(state, final(terms, state, inliers).inverse())
    parts = {"way_m": [0, 1, 2], "tilt_rad": [3, 4], "heading_rad": [5]}
    found: dict[str, Any] = {}
    for name, rows in parts.items():
        redundancy = max(float((1 - explained[:, rows]).sum()), 1.0)
        factor = np.sqrt((residuals[:, rows] ** 2).sum() / redundancy)
        found[name] = float(getattr(terms.noise, name) * np.clip(factor, 0.1, 10))
    return replace(terms.noise, **found)
