"""Prior knowledge: the map's frame, the survey, and the shared numbers."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.mapping.motions import offsets
from ros_visualise.estimation.mapping.normal import NormalEquations
from ros_visualise.estimation.mapping.problem import DistancePrior, Poses, Problem, TagPrior
from ros_visualise.estimation.mapping.unknowns import (
    MeasurementNoise,
    SharedLayout,
    SharedPrior,
    Unknowns,
    differences,
    mounting,
)
from ros_visualise.geometry.se3 import rotation_vector, turn_between

_FIXED = 1e-9  # standard deviation of a shared number that is not estimated
_ANCHOR = np.array([1e-4] * 3 + [1e-5] * 3)
"""Metres and radians, standard deviation that fixes the map to a tag."""
FIRST = np.array([0.05] * 3 + np.deg2rad([1.0, 1.0, 0.3]).tolist())
"""Standard deviations of tf at the first view, which defines the map's heading."""


def add_known(
    normal: NormalEquations,
    state: Unknowns,
    problem: Problem,
    prior: SharedPrior,
    noise: MeasurementNoise,
) -> float:
    """Add the map's frame, the survey, and the priors of the shared numbers; returns their sum."""
    sigmas = SharedLayout(problem.cameras).sigmas(prior)
    sigmas = np.where(sigmas > 0, sigmas, _FIXED)
    off = state.shared / sigmas
    normal.add(off[None], (), np.diag(1 / sigmas)[None])
    total = float(off @ off)
    if not problem.surveyed:
        total += _add_anchor(normal, state, problem)
    for one in problem.surveyed:
        total += _add_surveyed(normal, state, one, noise)
    for known in problem.distances:
        total += _add_distance(normal, state, known)
    return total


def _add_anchor(normal: NormalEquations, state: Unknowns, problem: Problem) -> float:
    """The first view is where tf says; without tf a tag defines the map."""
    odometry = problem.odometry
    if odometry is None:
        anchor = problem.anchor
        apart = np.concatenate([state.tags.t[anchor], rotation_vector(state.tags.R[anchor])])
        return _add_tag(normal, anchor, apart / _ANCHOR, np.diag(1 / _ANCHOR))
    T = odometry.T_fixed_camera[:1]
    first = Poses(state.views.R[:1], state.views.t[:1])

    def residuals(shared: Floats) -> Floats:
        R_x, t_x = mounting(shared)
        given = Poses(T[:, :3, :3] @ R_x, T[:, :3, 3] + T[:, :3, :3] @ t_x)
        apart: Floats = offsets(first, given) / FIRST
        return apart

    by_shared = differences(residuals, state.shared)
    J = np.diag(1 / FIRST)[None]
    there = residuals(state.shared)
    normal.add(there, ((np.array([0]), J),), by_shared)
    return float((there**2).sum())


def from_survey(state: Unknowns, known: TagPrior) -> Floats:
    """(6,) offset and rotation of a tag from its survey, in given standard deviations."""
    off = (state.tags.t[known.tag] - known.position_xyz) / known.position_sigma
    if known.R is None:
        return np.concatenate([off, np.zeros(3)])
    turned = turn_between(state.tags.R[known.tag], known.R) / known.R_sigma
    return np.concatenate([off, turned])


def _add_surveyed(
    normal: NormalEquations, state: Unknowns, known: TagPrior, noise: MeasurementNoise
) -> float:
    larger = np.repeat([noise.survey_position, noise.survey_turn], 3)
    weights = 1 / larger / np.concatenate([known.position_sigma, known.R_sigma])
    weights[3:] *= known.R is not None
    return _add_tag(normal, known.tag, from_survey(state, known) / larger, np.diag(weights))


def _add_distance(normal: NormalEquations, state: Unknowns, known: DistancePrior) -> float:
    a, b = known.tags
    apart = state.tags.t[b] - state.tags.t[a]
    length = max(float(np.linalg.norm(apart)), 1e-9)
    off = (length - known.distance_m) / known.sigma_m
    J = np.zeros((1, 1, 6))
    J[0, 0, :3] = apart / length / known.sigma_m
    views = normal.structure.views
    ends = (np.array([views + a]), -J), (np.array([views + b]), J)
    normal.add(np.array([[off]]), ends)
    return off**2


def _add_tag(normal: NormalEquations, tag: int, residual: Floats, J: Floats) -> float:
    normal.add(residual[None], ((np.array([normal.structure.views + tag]), J[None]),))
    return float(residual @ residual)
