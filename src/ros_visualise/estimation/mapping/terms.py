"""The terms of the sum of squares to be minimised: corners and odometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.mapping.intrinsics import by_intrinsics, root_of
from ros_visualise.estimation.mapping.motions import between, in_view, offsets, relative
from ros_visualise.estimation.mapping.normal import NormalEquations, SparseInverse, Structure
from ros_visualise.estimation.mapping.problem import (
    Corners,
    Poses,
    Problem,
    TagSighting,
    corners_of,
)
from ros_visualise.estimation.mapping.unknowns import (
    LONGER,
    PRINTED,
    UNKNOWN,
    MeasurementNoise,
    SharedLayout,
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
        layout: of the shared numbers.
        linear: (S, 8, G) pixels by which expected corners change with shared numbers, where that
            does not depend on the poses.
    """

    problem: Problem
    noise: MeasurementNoise = field(default_factory=MeasurementNoise)
    prior: SharedPrior = UNKNOWN
    corners: Corners = field(init=False)
    structure: Structure = field(init=False)
    layout: SharedLayout = field(init=False)
    linear: Floats = field(init=False)

    def __post_init__(self) -> None:
        self.corners = corners_of(self.problem.sightings)
        views, tags = self.problem.counts
        links = [np.column_stack([self.corners.views, self.corners.tags + views])]
        links += [np.reshape([one.tags for one in self.problem.distances], (-1, 2)) + views]
        if self.problem.odometry is not None:
            links.append(np.column_stack([np.arange(views - 1), np.arange(1, views)]))
        self.layout = SharedLayout(self.problem.cameras)
        self.linear = linear_errors(self.corners, self.problem.sightings, self.layout)
        self.structure = Structure(views, tags, self.layout.count, np.concatenate(links))

    def with_noise(self, **noise: Any) -> None:
        """Set other standard deviations."""
        self.noise = replace(self.noise, **noise)

    def sigma_px(self) -> Floats:
        """(S,) standard deviations of corner coordinates."""
        extra = np.broadcast_to(self.noise.extra_px, len(self.problem.cameras))
        sigma: Floats = np.hypot(self.corners.sigma_px, extra[self.corners.cameras])
        return sigma

    def eyes(self, state: Unknowns) -> Poses:
        """The cameras (S,) of the sightings in the map."""
        in_rig = self.layout.mounted(state.shared).at(self.corners.cameras)
        return state.views.at(self.corners.views).compose(in_rig)

    def by_poses(self, state: Unknowns, by_pose: Floats) -> tuple[Floats, Floats]:
        """Derivatives (S, K, 6) by tags in cameras, converted to those by views and by tags."""
        pivots = state.views.t[self.corners.views]
        return between(by_pose, self.eyes(state), pivots, state.tags.at(self.corners.tags))

    def residuals_px(self, state: Unknowns) -> Floats:
        """(S, 8) pixels from measured to expected corners."""
        return self.seen(state, np.ones(len(self.corners.views)))[0]

    def add_seen(self, normal: NormalEquations, state: Unknowns, weights: Floats) -> None:
        """Add the corners, each sighting with its weight (S,), divided by ``noise.views``."""
        residuals, by_pose, by_shared = self.seen(state, self.sigma_px())
        root = np.sqrt(weights / self.noise.views)[:, None]
        bad = ~np.asarray(np.isfinite(residuals).all(axis=1))
        residuals, root = np.where(bad[:, None], 0, residuals), np.where(bad[:, None], 0, root)
        by_view, by_tag = self.by_poses(state, by_pose * root[..., None])
        parts = (self.corners.views, by_view), (self.corners.tags + self.structure.views, by_tag)
        normal.add(residuals * root, parts, by_shared * root[..., None])

    def add_gone(self, normal: NormalEquations, state: Unknowns) -> Floats:
        """Add the odometry; returns its whitened residuals (N - 1, 6)."""
        residuals, whiten, by_shared = self.gone(state)
        first = np.arange(len(residuals))
        if len(first):
            by_view, by_next = _by_steps(state.views, whiten)
            normal.add(residuals, ((first, by_view), (first + 1, by_next)), by_shared)
        return residuals

    def explained(self, state: Unknowns, covariance: SparseInverse) -> Floats:
        """(N - 1, 6) variances of the odometry's whitened residuals that the unknowns explain."""
        _, whiten, by_shared = self.gone(state)
        first = np.arange(len(whiten))
        parts = _by_steps(state.views, whiten)
        return self.structure.variances(
            covariance, ((first, parts[0]), (first + 1, parts[1])), by_shared
        )

    def gone(self, state: Unknowns) -> tuple[Floats, Floats, Floats]:
        """Odometry residuals (N - 1, 6), their whitening, and derivatives by shared numbers."""
        odometry = self.problem.odometry
        if odometry is None:
            return np.zeros((0, 6)), np.zeros((0, 6, 6)), np.zeros((0, 6, self.layout.count))
        given = Poses(odometry.T_fixed_camera[:, :3, :3], odometry.T_fixed_camera[:, :3, 3])
        recorded_motion = relative(given)
        way = np.linalg.norm(recorded_motion.t, axis=1)
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
            apart = offsets(believed, _propagated(recorded_motion, shared))
            weighed: Floats = np.einsum("nij,nj->ni", whiten, apart)
            return weighed

        return residuals(state.shared), whiten, differences(residuals, state.shared)

    def seen(self, state: Unknowns, sigma_px: Floats) -> tuple[Floats, Floats, Floats]:
        """Residuals (S, 8), derivatives by the tag's pose in the camera, and by shared numbers."""
        tags, points, rays = self.corners.tags, self.corners.points, self.corners.rays
        eyes, bodies = self.eyes(state), state.tags.at(tags)
        R, t = in_view(eyes, bodies)
        whiten = np.eye(8) / sigma_px[:, None, None]
        printed = points * (1 + state.shared[PRINTED])
        residuals, by_pose = linearise(R, t, printed, rays, whiten)
        by_shared = self.linear / sigma_px[:, None, None]
        residuals = residuals + by_shared @ state.shared
        by_corner = by_pose[..., :3].reshape(-1, 4, 2, 3)
        away = points @ np.swapaxes(R, 1, 2)
        by_shared[..., PRINTED] = (by_corner @ away[..., None]).reshape(-1, 8)
        by_eye = between(by_pose, eyes, eyes.t, bodies)[0]
        for camera, columns in enumerate(self.layout.rig[1:], 1):
            rows = np.flatnonzero(self.corners.cameras == camera)
            given = self.problem.cameras[camera].T_first_camera[:3, :3]
            along = state.views.R[self.corners.views[rows]] @ given  # its axes, as given
            by_shift, by_turn = by_eye[rows, :, :3] @ along, by_eye[rows, :, 3:] @ eyes.R[rows]
            by_shared[rows, :, columns] = np.concatenate([by_shift, by_turn], axis=2)
        return residuals, by_pose, by_shared


def linear_errors(
    corners: Corners, sightings: Sequence[TagSighting], layout: SharedLayout
) -> Floats:
    """(S, 8, G) derivatives of expected corners by shared numbers, where poses do not matter."""
    found = np.zeros((len(sightings), 8, layout.count))
    for camera, one in enumerate(layout.cameras):
        rows = np.flatnonzero(corners.cameras == camera)
        found[rows, :, layout.larger[camera]] = corners.outward[rows].reshape(-1, 8)
        if one.calibration is None or not len(rows):
            continue
        info, directions = sightings[rows[0]].info, corners.rays.directions[rows]
        slopes = by_intrinsics(directions.reshape(-1, 3), info).reshape(len(rows), 8, -1)
        found[rows, :, layout.intrinsics[camera]] = slopes @ root_of(one.calibration, info)
    return found


def _by_steps(views: Poses, whiten: Floats) -> tuple[Floats, Floats]:
    """Derivatives (N - 1, K, 6) by relative poses of views, converted to those by both."""
    first = np.arange(len(whiten))
    before = views.at(first)
    return between(whiten, before, before.t, views.at(first + 1))


def _propagated(recorded_motion: Poses, shared: Floats) -> Poses:
    """Motions of the camera as mounted, from those of the camera according to tf."""
    R, t = mounting(shared)
    way = recorded_motion.t / (1 + shared[LONGER]) + recorded_motion.R @ t - t
    return Poses(R.T @ recorded_motion.R @ R, way @ R)
