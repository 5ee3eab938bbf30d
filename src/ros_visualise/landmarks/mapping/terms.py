"""The terms of the sum of squares to be minimised: corners and odometry."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.mapping.motions import between, in_view, offsets, relative
from ros_visualise.landmarks.mapping.normal import NormalEquations, SparseInverse, Structure
from ros_visualise.landmarks.mapping.problem import Corners, Poses, Problem, corners_of
from ros_visualise.landmarks.mapping.unknowns import (
    LARGER,
    LONGER,
    PRINTED,
    SHARED,
    UNKNOWN,
    MeasurementNoise,
    SharedPrior,
    Unknowns,
    differences,
    mounting,
)
from ros_visualise.landmarks.pose.refinement import linearise


@dataclass(eq=False)
class Terms:
    """The terms of a problem, evaluated by `seen` and `gone` at a state.

    Attributes:
        noise: of measurements.
        prior: of the shared numbers.
    """

    problem: Problem
    noise: MeasurementNoise = field(default_factory=MeasurementNoise)
    prior: SharedPrior = UNKNOWN
    corners: Corners = field(init=False)
    structure: Structure = field(init=False)

    def __post_init__(self) -> None:
        self.corners = corners_of(self.problem.sightings)
        views, tags = self.problem.counts
        links = [np.column_stack([self.corners.views, self.corners.tags + views])]
        links += [np.reshape([one.tags for one in self.problem.distances], (-1, 2)) + views]
        if self.problem.odometry is not None:
            links.append(np.column_stack([np.arange(views - 1), np.arange(1, views)]))
        self.structure = Structure(views, tags, SHARED, np.concatenate(links))

    def with_noise(self, **noise: float) -> None:
        """Set other standard deviations."""
        self.noise = replace(self.noise, **noise)

    def sigma_px(self) -> Floats:
        """(S,) standard deviations of corner coordinates."""
        sigma: Floats = np.hypot(self.corners.sigma_px, self.noise.extra_px)
        return sigma

    def residuals_px(self, state: Unknowns) -> Floats:
        """(S, 8) pixels from measured to expected corners."""
        return self.seen(state, np.ones(len(self.corners.views)))[0]

    def add_seen(self, normal: NormalEquations, state: Unknowns, weights: Floats) -> None:
        """Add the corners, each sighting with its weight (S,), divided by ``noise.views``."""
        residuals, by_pose, by_shared = self.seen(state, self.sigma_px())
        root = np.sqrt(weights / self.noise.views)[:, None]
        bad = ~np.asarray(np.isfinite(residuals).all(axis=1))
        residuals, root = np.where(bad[:, None], 0, residuals), np.where(bad[:, None], 0, root)
        views, tags = self.corners.views, self.corners.tags
        by_view, by_tag = between(by_pose * root[..., None], state.views, state.tags, views, tags)
        parts = (views, by_view), (tags + self.structure.views, by_tag)
        normal.add(residuals * root, parts, by_shared * root[..., None])

    def add_gone(self, normal: NormalEquations, state: Unknowns) -> Floats:
        """Add the odometry; returns its whitened residuals (N - 1, 6)."""
        residuals, whiten, by_shared = self.gone(state)
        first = np.arange(len(residuals))
        if len(first):
            by_view, by_next = between(whiten, state.views, state.views, first, first + 1)
            normal.add(residuals, ((first, by_view), (first + 1, by_next)), by_shared)
        return residuals

    def explained(self, state: Unknowns, covariance: SparseInverse) -> Floats:
        """(N - 1, 6) variances of the odometry's whitened residuals that the unknowns explain."""
        _, whiten, by_shared = self.gone(state)
        first = np.arange(len(whiten))
        parts = between(whiten, state.views, state.views, first, first + 1)
        return self.structure.variances(
            covariance, ((first, parts[0]), (first + 1, parts[1])), by_shared
        )

    def gone(self, state: Unknowns) -> tuple[Floats, Floats, Floats]:
        """Odometry residuals (N - 1, 6), their whitening, and derivatives by shared numbers."""
        odometry = self.problem.odometry
        if odometry is None:
            return np.zeros((0, 6)), np.zeros((0, 6, 6)), np.zeros((0, 6, SHARED))
        given = Poses(odometry.T_fixed_camera[:, :3, :3], odometry.T_fixed_camera[:, :3, 3])
        told = relative(given)
        way = np.linalg.norm(told.t, axis=1)
        n = self.noise
        variances = np.column_stack(
            [
                way * s**2 + still**2
                for s, still in (
                    (n.way_m, n.still_m),
                    (n.tilt_rad, n.still_rad),
                    (n.heading_rad, n.still_rad),
                )
            ]
        )[:, [0, 0, 0, 1, 1, 2]]
        upright = given.R[:-1]
        whiten = np.zeros((len(way), 6, 6))
        whiten[:, :3, :3] = whiten[:, 3:, 3:] = upright
        whiten /= np.sqrt(variances)[..., None]
        believed = relative(state.views)

        def residuals(shared: Floats) -> Floats:
            apart = offsets(believed, _carried(told, shared))
            weighed: Floats = np.einsum("nij,nj->ni", whiten, apart)
            return weighed

        return residuals(state.shared), whiten, differences(residuals, state.shared)

    def seen(self, state: Unknowns, sigma_px: Floats) -> tuple[Floats, Floats, Floats]:
        """Residuals (S, 8), derivatives by the tag's pose in the camera, and by shared numbers."""
        views, tags, points, rays, _, outward = self.corners
        R, t = in_view(state.views, state.tags, views, tags)
        whiten = np.eye(8) / sigma_px[:, None, None]
        printed = points * (1 + state.shared[PRINTED])
        residuals, by_pose = linearise(R, t, printed, rays, whiten)
        by_shared = np.zeros((*residuals.shape, SHARED))
        by_shared[..., LARGER] = outward.reshape(len(views), 8) / sigma_px[:, None]
        by_corner = by_pose[..., :3].reshape(-1, 4, 2, 3)
        away = points @ np.swapaxes(R, 1, 2)
        by_shared[..., PRINTED] = (by_corner @ away[..., None]).reshape(-1, 8)
        residuals = residuals + state.shared[LARGER] * by_shared[..., LARGER]
        return residuals, by_pose, by_shared


def _carried(told: Poses, shared: Floats) -> Poses:
    """Motions of the camera as mounted, from those of the camera according to tf."""
    R, t = mounting(shared)
    way = told.t / (1 + shared[LONGER]) + told.R @ t - t
    return Poses(R.T @ told.R @ R, way @ R)
