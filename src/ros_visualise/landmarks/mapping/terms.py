"""The terms of the sum of squares that is made least: corners, odometry, and what was surveyed.

The six numbers of a pose are changes of its position, and a rotation, along and about the axes of
the map. The shared numbers are, in this order, by how many pixels tags are seen too large, by how
much the odometry takes ways for too long, by how much the camera is elsewhere and turned than the
frames tell, along and about its own axes, and by how much all tags are larger than their size.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.mapping.normal import Normal, Numbers
from ros_visualise.landmarks.mapping.problem import (
    Corners,
    DistancePrior,
    Poses,
    Problem,
    TagPrior,
    corners_of,
)
from ros_visualise.landmarks.pose.refinement import linearise, moved, turn

SHARED = 9
LARGER, LONGER, MOUNTING, PRINTED = 0, 1, slice(2, 8), 8
"""Which of the shared numbers is which."""

_STEP = 1e-6  # of derivatives by differences
_ANCHOR = np.array([1e-4] * 3 + [1e-5] * 3)
"""Metres and radians, that fix the map to a tag."""
FIRST = np.array([0.05] * 3 + np.deg2rad([1.0, 1.0, 0.3]).tolist())
"""How far the frames are trusted where the first view is; the map has its heading from there."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of what is measured.

    Attributes:
        extra_px: what the camera adds to that of corners, which their tag's size tells.
        way_m, tilt_rad, heading_rad: errors of the odometry after a metre; they grow with the root
            of the way.
        still_m, still_rad: what is added between any two views.
    """

    extra_px: float = 0.0
    way_m: float = 0.03
    tilt_rad: float = math.radians(0.1)
    heading_rad: float = math.radians(0.3)
    still_m: float = 1e-3
    still_rad: float = math.radians(0.02)


@dataclass(frozen=True)
class Prior:
    """Standard deviations of the shared numbers; 0: they stay as they are."""

    larger_px: float = 0.5
    longer: float = 0.03
    mounting_m: float = 0.0
    mounting_rad: float = 0.0
    printed: float = 0.0

    @property
    def sigmas(self) -> Floats:
        """(9,)"""
        mounting = [self.mounting_m] * 3 + [self.mounting_rad] * 3
        return np.array([self.larger_px, self.longer, *mounting, self.printed])


UNKNOWN = Prior()
"""But for the camera's mounting, which is as the frames tell."""


class State(NamedTuple):
    """All that is looked for."""

    views: Poses
    tags: Poses
    shared: Floats

    def moved(self, of_views: Floats, rest: Floats) -> State:
        """Changed by steps (N, 6) and (D,)."""
        count = len(self.tags.t)
        of_tags = rest[: 6 * count].reshape(count, 6)
        return State(
            Poses(*moved(*self.views, of_views)),
            Poses(*moved(*self.tags, of_tags)),
            self.shared + rest[6 * count :],
        )


@dataclass(eq=False)
class Terms:
    """The terms of a problem, which `seen`, `gone` and `surveyed` tell at a state.

    Attributes:
        noise: of what is measured.
        prior: of the shared numbers.
    """

    problem: Problem
    noise: Noise = field(default_factory=Noise)
    prior: Prior = UNKNOWN
    corners: Corners = field(init=False)

    def __post_init__(self) -> None:
        self.corners = corners_of(self.problem.sightings)

    def with_noise(self, **noise: float) -> None:
        """Take other standard deviations."""
        self.noise = replace(self.noise, **noise)

    def sigma_px(self) -> Floats:
        """(S,) of the coordinates of corners."""
        sigma: Floats = np.hypot(self.corners.sigma_px, self.noise.extra_px)
        return sigma

    def residuals_px(self, state: State) -> Floats:
        """(S, 8) pixels from where corners are seen to where they should be."""
        return self.seen(state, np.ones(len(self.corners.views)))[0]

    def add_seen(self, normal: Normal, state: State, weights: Floats) -> None:
        """The corners, each sighting by its weight (S,)."""
        residuals, by_pose, by_shared = self.seen(state, self.sigma_px())
        root = np.sqrt(weights)[:, None]
        bad = ~np.asarray(np.isfinite(residuals).all(axis=1))
        residuals, root = np.where(bad[:, None], 0, residuals), np.where(bad[:, None], 0, root)
        views, tags = self.corners.views, self.corners.tags
        by_view, by_tag = between(by_pose * root[..., None], state.views, state.tags, views, tags)
        normal.add(
            residuals * root, by_shared * root[..., None], (views, by_view), tags=((tags, by_tag),)
        )

    def add_gone(self, normal: Normal, state: State) -> Floats:
        """The odometry; returns its residuals (N - 1, 6) by their deviations."""
        residuals, whiten, by_shared = self.gone(state)
        first = np.arange(len(residuals))
        if len(first):
            by_view, by_next = between(whiten, state.views, state.views, first, first + 1)
            normal.add(residuals, by_shared, (first, by_view), by_next)
        return residuals

    def probe(self, state: State, signs: Floats, normal: Normal) -> tuple[Floats, Floats]:
        """J'b of the odometry, as right-hand sides of `solve`: of b (N - 1, 6)."""
        _, whiten, by_shared = self.gone(state)
        first = np.arange(len(signs))
        by_view, by_next = between(whiten, state.views, state.views, first, first + 1)
        of_views, of_rest = np.zeros_like(normal.slope_own), np.zeros_like(normal.slope_rest)
        of_views[:-1] += np.einsum("nki,nk->ni", by_view, signs)
        of_views[1:] += np.einsum("nki,nk->ni", by_next, signs)
        of_rest[6 * normal.tags :] = np.einsum("nki,nk->i", by_shared, signs)
        return of_views, of_rest

    def gone(self, state: State) -> tuple[Floats, Floats, Floats]:
        """Of the odometry the residuals (N - 1, 6), what weighs them, and shared derivatives."""
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
            off = _off(believed, _carried(told, shared))
            weighed: Floats = np.einsum("nij,nj->ni", whiten, off)
            return weighed

        return residuals(state.shared), whiten, _differences(residuals, state.shared)

    def add_known(self, normal: Normal, state: State) -> float:
        """What fixes the map, what was surveyed, what is known of the shared numbers; their sum."""
        sigmas = self.prior.sigmas
        free = sigmas > 0
        G = slice(6 * normal.tags, None)
        information = np.where(free, 1 / np.where(free, sigmas, 1) ** 2, 1e18)
        normal.rest[G, G] += np.diag(information)
        normal.slope_rest[G] += information * state.shared
        total = float(information @ state.shared**2)
        if not self.problem.surveyed:
            total += self._add_anchor(normal, state)
        for one in self.problem.surveyed:
            total += _add_surveyed(normal, state, one)
        for known in self.problem.distances:
            total += _add_distance(normal, state, known)
        return total

    def _add_anchor(self, normal: Normal, state: State) -> float:
        """The first view is where the frames say; without frames a tag is the map."""
        odometry = self.problem.odometry
        if odometry is None:
            anchor = self.problem.anchor
            off = np.concatenate([state.tags.t[anchor], logarithm(state.tags.R[anchor])])
            return _add_tag(normal, anchor, off / _ANCHOR, np.diag(1 / _ANCHOR))
        T = odometry.T_fixed_camera[:1]
        first = Poses(state.views.R[:1], state.views.t[:1])

        def residuals(shared: Floats) -> Floats:
            R_x, t_x = _mounting(shared)
            given = Poses(T[:, :3, :3] @ R_x, T[:, :3, 3] + T[:, :3, :3] @ t_x)
            off: Floats = _off(first, given) / FIRST
            return off

        by_shared = _differences(residuals, state.shared)
        J = np.diag(1 / FIRST)[None]
        there = residuals(state.shared)
        normal.add(there, by_shared, (np.array([0]), J))
        return float((there**2).sum())

    def seen(self, state: State, sigma_px: Floats) -> tuple[Floats, Floats, Floats]:
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


def relative(poses: Poses) -> Poses:
    """Each of N poses in the one before it: N - 1 poses."""
    back = np.swapaxes(poses.R[:-1], 1, 2)
    return Poses(back @ poses.R[1:], np.einsum("nij,nj->ni", back, np.diff(poses.t, axis=0)))


def in_view(views: Poses, bodies: Poses, of_view: Numbers, of_body: Numbers) -> Poses:
    """Bodies in the frames of views."""
    back = np.swapaxes(views.R[of_view], 1, 2)
    apart = bodies.t[of_body] - views.t[of_view]
    return Poses(back @ bodies.R[of_body], (back @ apart[..., None])[..., 0])


def between(
    by_pose: Floats, views: Poses, bodies: Poses, of_view: Numbers, of_body: Numbers
) -> tuple[Floats, Floats]:
    """Derivatives (S, K, 6) by poses of bodies in views, as ones by the views and by the bodies."""
    back = np.swapaxes(views.R[of_view], 1, 2)
    apart = bodies.t[of_body] - views.t[of_view]
    by_place, by_turn = by_pose[..., :3] @ back, by_pose[..., 3:] @ back
    swung = np.cross(by_place, apart[:, None])  # a . (d x w) = (a x d) . w
    by_body = np.concatenate([by_place, by_turn], axis=2)
    return np.concatenate([-by_place, swung - by_turn], axis=2), by_body


def logarithm(R: Floats) -> Floats:
    """(3,) the rotation vector of a rotation matrix."""
    return np.asarray(cv2.Rodrigues(R)[0], np.float64)[:, 0]


def logarithms(R: Floats) -> Floats:
    """(N, 3) of rotations (N, 3, 3) by less than 180 degrees."""
    skew = R - np.swapaxes(R, 1, 2)
    sine2 = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    cosine2 = np.trace(R, axis1=1, axis2=2) - 1
    sine = np.linalg.norm(sine2, axis=1)
    angle = np.arctan2(sine, cosine2)
    scale = np.where(sine > 1e-9, angle / np.where(sine > 1e-9, sine, 1), 0.5)
    vectors: Floats = sine2 * scale[:, None]
    return vectors


def _off(believed: Poses, told: Poses) -> Floats:
    """(N, 6) by how much poses are elsewhere, and turned, along and about the axes of both."""
    turned = logarithms(believed.R @ np.swapaxes(told.R, 1, 2))
    return np.concatenate([believed.t - told.t, turned], axis=1)


def _mounting(shared: Floats) -> tuple[Floats, Floats]:
    """R and t of the camera in the camera's frame as the frames tell it."""
    return turn(shared[MOUNTING][3:]), shared[MOUNTING][:3]


def _carried(told: Poses, shared: Floats) -> Poses:
    """Motions of the camera as it is, by those of the camera as the frames have it."""
    R, t = _mounting(shared)
    way = told.t / (1 + shared[LONGER]) + told.R @ t - t
    return Poses(R.T @ told.R @ R, way @ R)


def _differences(residuals: Callable[[Floats], Floats], shared: Floats) -> Floats:
    """(N, 6, 9) derivatives by the shared numbers."""
    columns = [
        (residuals(shared + step) - residuals(shared - step)) / (2 * _STEP)
        for step in _STEP * np.eye(SHARED)
    ]
    return np.stack(columns, axis=2)


def _add_surveyed(normal: Normal, state: State, known: TagPrior) -> float:
    off = (state.tags.t[known.tag] - known.position_xyz) / known.position_sigma
    total = _add_tag(normal, known.tag, off, np.diag(1 / known.position_sigma) @ np.eye(3, 6))
    if known.R is not None:
        turned = logarithm(state.tags.R[known.tag] @ known.R.T) / known.R_sigma
        total += _add_tag(normal, known.tag, turned, np.diag(1 / known.R_sigma) @ np.eye(6)[3:])
    return total


def _add_distance(normal: Normal, state: State, known: DistancePrior) -> float:
    a, b = known.tags
    apart = state.tags.t[b] - state.tags.t[a]
    length = max(float(np.linalg.norm(apart)), 1e-9)
    off = (length - known.distance_m) / known.sigma_m
    J = np.zeros((1, 1, 6))
    J[0, 0, :3] = apart / length / known.sigma_m
    ends = (np.array([a]), -J), (np.array([b]), J)
    normal.add(np.array([[off]]), np.zeros((1, 1, SHARED)), tags=ends)
    return off**2


def _add_tag(normal: Normal, tag: int, residual: Floats, J: Floats) -> float:
    shared = np.zeros((1, len(residual), SHARED))
    normal.add(residual[None], shared, tags=((np.array([tag]), J[None]),))
    return float(residual @ residual)
