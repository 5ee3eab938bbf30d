"""Bundle adjustment: poses of a camera and points that fit best to where the points are seen.

A point is a direction in the view where it was first seen, its *host*, and its inverse depth, so
that points at any distance are alike. Errors of poses are twists of the map, as everywhere in
`ros_visualise.estimation`. Moved by the same twist, a view and a host see the same: so a sighting
depends on the difference of their twists, and on nothing that depends on where they are. A right
camera moves with the left one by the same twist.

Sightings are an array of all views and points, NaN where a view does not see a point: few are, and
all at once are faster than one by one.

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
        points = self.points + changes
        points[:, 2] = np.maximum(points[:, 2], 1e-6)
        return replace(self, R=R, p=p, points=points)

    def homogeneous(self) -> Floats:
        """(P, 4) the points in the map: xyz times the inverse depth, and that."""
        R, p = self.R[self.host], self.p[self.host]
        u, v, rho = self.points.T[..., None]
        return np.hstack([R[:, :, 0] * u + R[:, :, 1] * v + R[:, :, 2] + rho * p, rho])

    def eyes(self) -> tuple[Floats, Floats]:
        """(F C, 3, 3) and (F C, 3) T_map_camera of all cameras, those of a view side by side."""
        R = self.R[:, None] @ self.cameras[:, :3, :3]
        p = self.p[:, None] + (self.R[:, None] @ self.cameras[:, :3, 3:])[..., 0]
        return R.reshape(-1, 3, 3), p.reshape(-1, 3)


class Linearized(NamedTuple):
    """Residuals (F C, P, 2), which of them are valid (F C, P), and their derivatives.

    Those by the twist of the view (F C, P, 2, 6) are those by the twist of the host, negative;
    those by the point are (F C, P, 2, 3). All are zero where a residual is not valid.
    """

    residuals: Floats
    is_valid: Mask
    by_view: Floats
    by_point: Floats


def project(points: Floats, R: Floats, p: Floats, rays: Floats) -> tuple[Floats, Floats, Mask]:
    """Residuals (V, P, 2) of rays, measured minus expected; depths; which of them are valid.

    Args:
        points: (P, 4) homogeneous.
        R, p: (V, 3, 3) and (V, 3).
        rays: (V, P, 2), NaN where a point is not seen.

    Returns:
        Also depths (V, P) times the inverse depth at the host.
    """
    seen = points[:, :3] @ R - points[:, 3:] * (p[:, None] @ R)
    depth = seen[..., 2]
    is_valid = (depth > _NEAR) & np.isfinite(rays[..., 0])
    depth = np.where(is_valid, depth, 1.0)
    residuals = np.where(is_valid[..., None], rays - seen[..., :2] / depth[..., None], 0.0)
    return residuals, depth, is_valid


def by_twist(points: Floats, R: Floats, expected: Floats, depth: Floats) -> Floats:
    """(V, P, 2, 6) derivatives of the expected directions (V, P, 2) by twists of the views."""
    rows = np.swapaxes(R, 1, 2)[:, None]
    flat = (rows[:, :, :2] - expected[..., None] * rows[:, :, 2:]) / depth[..., None, None]
    x, y, z = flat[..., 0], flat[..., 1], flat[..., 2]
    px, py, pz, rho = points.T[..., None]
    found = np.empty((*flat.shape[:3], 6))
    np.multiply(flat, -rho[..., None], out=found[..., :3])
    found[..., 3] = y * pz - z * py
    found[..., 4] = z * px - x * pz
    found[..., 5] = x * py - y * px
    return found


def linearize(scene: BundleScene, rays: Floats) -> Linearized:
    """Residuals, measured minus expected, and derivatives of the expected directions.

    ``rays`` (F C, P, 2): x and y of directions at z = 1 in the cameras of `BundleScene.eyes`.
    """
    R, p = scene.eyes()
    points = scene.homogeneous()
    residuals, depth, is_valid = project(points, R, p, rays)
    expected = np.where(is_valid[..., None], rays - residuals, 0.0)
    by_view = by_twist(points, R, expected, depth)
    back = np.swapaxes(R, 1, 2)
    axes = np.empty((len(R), len(scene.R), 3, 3))  # of each host in each view, and the way to it
    axes[..., :2] = back[:, None] @ scene.R[:, :, :2]
    axes[..., 2] = (back[:, None] @ (scene.p - p[:, None])[..., None])[..., 0]
    axes = axes[:, scene.host]
    by_point = axes[:, :, :2] - expected[..., None] * axes[:, :, 2:]
    by_point /= depth[..., None, None]
    invalid = ~is_valid
    by_view[invalid], by_point[invalid] = 0, 0
    return Linearized(residuals, is_valid, by_view, by_point)


class Normal(NamedTuple):
    """Normal equations of views and points: H x = g, that of points apart.

    Attributes:
        H, g: (6 F, 6 F) and (6 F,).
        V, v: (P, 3, 3) and (P, 3) of the points.
        W: (P, 6 F, 3) between both.
        cost: half of the sum of squares.
    """

    H: Floats
    g: Floats
    V: Floats
    v: Floats
    W: Floats
    cost: float

    def reduced(self, damping: float) -> tuple[Floats, Floats, Floats]:
        """H and g of the views alone, and the (P, 3, 3) inverses of what was eliminated."""
        V = self.V * (1 + damping * _EYE) + 1e-9 * _EYE
        inverse = np.asarray(np.linalg.inv(V), np.float64)
        shape = len(self.H), 3 * len(V)
        WV = (self.W @ inverse).swapaxes(0, 1).reshape(shape)
        H = self.H - WV @ self.W.swapaxes(0, 1).reshape(shape).T
        return H, self.g - WV @ self.v.ravel(), inverse

    def points_of(self, x: Floats, inverse: Floats) -> Floats:
        """(P, 3) changes of points after the views were moved by x (6 F,)."""
        left = self.v - x @ self.W
        changes: Floats = (inverse @ left[..., None])[..., 0]
        return changes


def normal(scene: BundleScene, rays: Floats, sigma: float, alike: float = 1.0) -> Normal:
    """The normal equations of all sightings, as `linearize` takes them.

    Args:
        sigma: standard deviation of directions.
        alike: sightings that are as good as an independent one.
    """
    r, _, A, B = linearize(scene, rays)
    off = np.sqrt((r * r).sum(axis=2)) / sigma
    w = np.sqrt(np.minimum(1.0, HUBER / np.maximum(off, 1e-9)) / alike) / sigma
    cost = np.where(off < HUBER, off**2 / 2, HUBER * (off - HUBER / 2)).sum() / alike
    A, B, r = A * w[..., None, None], B * w[..., None, None], r * w[..., None]
    F, P = len(scene.R), len(scene.points)
    H, g = _of_views(scene, np.concatenate([A, r[..., None]], axis=3))
    by_points = np.swapaxes(B, 0, 1).reshape(P, 2 * len(B), 3)
    V = np.swapaxes(by_points, 1, 2) @ by_points
    v = (np.swapaxes(r, 0, 1).reshape(P, 1, 2 * len(B)) @ by_points)[:, 0]
    AB = A[:, :, 0, :, None] * B[:, :, 0, None] + A[:, :, 1, :, None] * B[:, :, 1, None]
    AB = AB.reshape(F, len(scene.cameras), P, 6, 3).sum(axis=1)
    AB[scene.host, np.arange(P)] -= AB.sum(axis=0)
    return Normal(H, g, V, v, AB.swapaxes(0, 1).reshape(P, 6 * F, 3), float(cost))


def _of_views(scene: BundleScene, J: Floats) -> tuple[Floats, Floats]:
    """H and g of derivatives by views, with residuals as the last column (F C, P, 2, 7)."""
    F = len(scene.R)
    pairs = np.zeros((F, F, 7, 7))  # of hosts and views
    for host in np.unique(scene.host):
        own = J[:, scene.host == host].reshape(len(J), -1, 7)
        pairs[host] = (np.swapaxes(own, 1, 2) @ own).reshape(F, -1, 7, 7).sum(axis=1)
    across = pairs[..., :6, :6] + pairs[..., :6, :6].swapaxes(0, 1)
    H = -across
    every = np.arange(F)
    H[every, every] += across.sum(axis=1)
    g = pairs[..., :6, 6].sum(axis=0) - pairs[..., :6, 6].sum(axis=1)
    return H.swapaxes(1, 2).reshape(6 * F, 6 * F), g.ravel()


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
