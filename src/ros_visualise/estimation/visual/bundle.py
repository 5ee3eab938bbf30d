"""Bundle adjustment: poses of a camera and points that fit best to where the points are seen.

A point is a direction in the view where it was first seen, its *host*, and its inverse depth, so
that points at any distance are alike. Errors of poses are twists of the map, as everywhere in
`ros_visualise.estimation`. Moved by the same twist, a view and a host see the same: so a sighting
depends on the difference of their twists, and on nothing that depends on where they are. A right
camera moves with the left one by the same twist.

Sightings are an array of all views and points, NaN where a view does not see a point. See
`ros_visualise.estimation.visual.equations` for the solution.

Source: B. Triggs et al., Bundle adjustment, a modern synthesis, 2000; J. Civera et al., Inverse
depth parametrization for monocular SLAM, 2008; P. Huber, Robust statistics, 1981.
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
NEAR = 1e-3
"""Least depth, in units of that of the host."""


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
    is_valid = (depth > NEAR) & np.isfinite(rays[..., 0])
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
