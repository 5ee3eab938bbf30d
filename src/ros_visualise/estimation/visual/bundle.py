"""Bundle adjustment: poses of a camera and points that fit best to where the points are seen.

A point is a direction in the view where it was first seen, its *host*, and its inverse depth, so
that points at any distance are alike. Errors of poses are twists of the map, as everywhere in
`ros_visualise.estimation`. Moved by the same twist, a view and a host see the same: so a sighting
depends on the difference of their twists, and on nothing that depends on where they are. A right
camera moves with the left one by the same twist.

Source: B. Triggs et al., Bundle adjustment, a modern synthesis, 2000 (the elimination of points);
J. Civera et al., Inverse depth parametrization for monocular SLAM, 2008; P. Huber, Robust
statistics, 1981.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.estimation.resting import Indices
from ros_visualise.geometry import se3

Mask = npt.NDArray[np.bool_]

HUBER = 2.0
"""Residuals above so many standard deviations count less."""
_NEAR = 1e-3  # least depth, in units of that of the host
_EYE = np.eye(3)


class Sightings(NamedTuple):
    """Sightings of points in views.

    Attributes:
        point, view: (N,) indices.
        camera: (N,) index of the camera: 0 left, 1 right.
        rays: (N, 2) x and y of directions at z = 1.
    """

    point: Indices
    view: Indices
    camera: Indices
    rays: Floats

    def chosen(self, kept: Mask | Indices) -> Sightings:
        """Some of them."""
        point, view, camera, rays = self
        return Sightings(point[kept], view[kept], camera[kept], rays[kept])


@dataclass(frozen=True, eq=False)
class BundleScene:
    """Views and points.

    Attributes:
        R, p: (F, 3, 3) and (F, 3) T_map_camera of the views' left cameras.
        host: (P,) index of the view of each point.
        points: (P, 3) x and y of their directions there at z = 1, and inverse depths.
        cameras: T_left_camera (C, 4, 4) of the cameras.
    """

    R: Floats
    p: Floats
    host: Indices
    points: Floats
    cameras: Floats

    def moved(self, twists: Floats, changes: Floats) -> BundleScene:
        """The same, moved by twists (F, 6) and changes of points (P, 3)."""
        R, p = se3.moved(twists, self.R, self.p)
        U, _, Vt = np.linalg.svd(R)  # or else errors of rounding would double at each keyframe
        points = self.points + changes
        points[:, 2] = np.maximum(points[:, 2], 1e-6)
        return replace(self, R=U @ Vt, p=p, points=points)


class Linearized(NamedTuple):
    """Residuals (N, 2), which of them are valid, and their derivatives.

    Those by the twist of the view (N, 2, 6) are those by the twist of the host, negative; those by
    the point are (N, 2, 3).
    """

    residuals: Floats
    is_in_front: Mask
    by_view: Floats
    by_point: Floats


def linearize(scene: BundleScene, sightings: Sightings) -> Linearized:
    """Residuals, measured minus expected, and derivatives of the expected directions."""
    point, view, camera, rays = sightings
    host = scene.host[point]
    T = scene.cameras[camera]
    R_view = scene.R[view] @ T[:, :3, :3]
    p_view = scene.p[view] + (scene.R[view] @ T[:, :3, 3:])[..., 0]
    uv, rho = scene.points[point, :2], scene.points[point, 2:]
    R_host, p_host = scene.R[host], scene.p[host]
    direction = (R_host[:, :, :2] @ uv[..., None])[..., 0] + R_host[:, :, 2]
    back = np.swapaxes(R_view, 1, 2)
    seen = (back @ (direction + rho * (p_host - p_view))[..., None])[..., 0]
    depth = np.where(seen[:, 2] > _NEAR, seen[:, 2], 1.0)[:, None]
    expected = seen[:, :2] / depth
    flat = back[:, :2] - expected[..., None] * back[:, 2:]
    flat = flat / depth[..., None]  # (N, 2, 3) by a point of the map, times its inverse depth
    by_view = np.empty((len(point), 2, 6))
    by_view[..., :3] = -flat * rho[..., None]
    by_view[..., 3:] = flat @ se3.cross(direction + rho * p_host)
    by_point = np.empty((len(point), 2, 3))
    by_point[..., :2] = flat @ R_host[:, :, :2]
    by_point[..., 2] = (flat @ (p_host - p_view)[..., None])[..., 0]
    return Linearized(rays - expected, seen[:, 2] > _NEAR, by_view, by_point)


def weights(residuals: Floats, sigma: float) -> Floats:
    """(N,) weights of residuals (N, 2) by Huber's rule, divided by the variance."""
    off = np.linalg.norm(residuals, axis=1) / sigma
    weights: Floats = np.minimum(1.0, HUBER / np.maximum(off, 1e-9)) / sigma**2
    return weights


class Normal(NamedTuple):
    """Normal equations of views and points: H x = g, that of points apart.

    Attributes:
        H, g: (6 F, 6 F) and (6 F,).
        V, v: (P, 3, 3) and (P, 3) of the points.
        W: (6 F, P, 3) between both.
        cost: half of the sum of squares.
    """

    H: Floats
    g: Floats
    V: Floats
    v: Floats
    W: Floats
    cost: float

    def divided(self, by: float) -> Normal:
        """The same of a cost divided by a number."""
        H, g, V, v, W, cost = self
        return Normal(H / by, g / by, V / by, v / by, W / by, cost / by)

    def reduced(self, damping: float) -> tuple[Floats, Floats, Floats]:
        """H and g of the views alone, and the (P, 3, 3) inverses of what was eliminated."""
        V = self.V * (1 + damping * _EYE) + 1e-9 * _EYE
        inverse = np.asarray(np.linalg.inv(V), np.float64)
        WV = np.einsum("apb,pbc->apc", self.W, inverse).reshape(len(self.H), -1)
        H = self.H - WV @ self.W.reshape(len(self.H), -1).T
        return H, self.g - WV @ self.v.ravel(), inverse

    def points_of(self, x: Floats, inverse: Floats) -> Floats:
        """(P, 3) changes of points after the views were moved by x (6 F,)."""
        left = self.v - np.einsum("a,apb->pb", x, self.W)
        changes: Floats = (inverse @ left[..., None])[..., 0]
        return changes


def normal(scene: BundleScene, sightings: Sightings, sigma: float) -> Normal:
    """The normal equations of all sightings."""
    found = linearize(scene, sightings)
    ok = found.is_in_front
    point, view = sightings.point[ok], sightings.view[ok]
    r, A, B = found.residuals[ok], found.by_view[ok], found.by_point[ok]
    w = weights(r, sigma)
    squares = (r * r).sum(axis=1)
    off = np.sqrt(squares) / sigma
    cost = float(np.where(off < HUBER, off**2 / 2, HUBER * (off - HUBER / 2)).sum())
    F, P = len(scene.R), len(scene.points)
    host = scene.host[point]
    wA, wB = A * w[:, None, None], B * w[:, None, None]
    AA = np.swapaxes(wA, 1, 2) @ A
    Ar = (np.swapaxes(wA, 1, 2) @ r[..., None])[..., 0]
    AB = np.swapaxes(wA, 1, 2) @ B
    H = np.zeros((F, F, 6, 6))
    pairs = _sums(host * F + view, AA.reshape(-1, 36), F * F).reshape(F, F, 6, 6)
    across = pairs + pairs.swapaxes(0, 1)
    H -= across
    every = np.arange(F)
    H[every, every] += across.sum(axis=1)
    g = _sums(view, Ar, F) - _sums(host, Ar, F)
    V = _sums(point, (np.swapaxes(wB, 1, 2) @ B).reshape(-1, 9), P).reshape(P, 3, 3)
    v = _sums(point, (np.swapaxes(wB, 1, 2) @ r[..., None])[..., 0], P)
    flat = AB.reshape(-1, 18)
    W = _sums(point * F + view, flat, P * F) - _sums(point * F + host, flat, P * F)
    W = W.reshape(P, F, 6, 3).transpose(1, 2, 0, 3).reshape(6 * F, P, 3)
    return Normal(H.swapaxes(1, 2).reshape(6 * F, 6 * F), g.ravel(), V, v, W, cost)


def _sums(group: Indices, values: Floats, count: int) -> Floats:
    """(count, m) sums of rows (N, m) that are of the same group (N,)."""
    sums = np.zeros((count, values.shape[1]))
    order = np.argsort(group, kind="stable")
    group = group[order]
    starts = np.flatnonzero(np.diff(group, prepend=-1))
    if len(group):
        sums[group[starts]] = np.add.reduceat(values[order], starts, axis=0)
    return sums


def triangulated(R: Floats, p: Floats, rays_host: Floats, rays: Floats) -> tuple[Floats, Floats]:
    """Inverse depths (N,) of directions (N, 2) in a host, and their standard deviations' factors.

    Args:
        R, p: T_view_host.
        rays_host, rays: directions of the same points in host and view.

    Returns:
        Inverse depths, and what their standard deviations are of that of a direction.
    """
    far = rays_host @ R[:, :2].T + R[:, 2]
    # rays = (far + rho p)[:2] / (far + rho p)[2], linear in rho
    by_rho = p[:2] - rays * p[2]
    left = rays * far[:, 2:] - far[:, :2]
    squares = (by_rho**2).sum(axis=1)
    rho = (by_rho * left).sum(axis=1) / np.maximum(squares, 1e-18)
    return rho, np.abs(far[:, 2] + rho * p[2]) / np.sqrt(np.maximum(squares, 1e-18))
