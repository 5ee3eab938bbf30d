"""Normal equations of views and points from a list of sightings.

It is a list because most views do not see most points. The arrays of sightings have the small axes
first: numpy is fast along a long last axis. Each point is eliminated by a Cholesky factor L of its
own 3x3 block. With the block W between views and points, the points reduce the information of the
views by U U', where U = W inv(L)'.

Source: B. Triggs et al., Bundle adjustment, a modern synthesis, 2000, section 6.1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.resting import Indices
from ros_visualise.estimation.visual.bundle import HUBER, NEAR, BundleScene, Mask

_LEAST = 1e-9  # information of a point, so that one without parallax can be eliminated


class Sightings:
    """Sightings of points; those of the same host and view are side by side.

    Args:
        rays: (F C, P, 2) directions at z = 1, NaN where a camera of a view does not see a point.
        host: (P,) index of the view of each point.
        cameras: number C of cameras.

    Attributes:
        eye, view, point: (N,) indices of the cameras of all views, of the views, and of the points.
        rays: (2, N).
    """

    def __init__(self, rays: Floats, host: Indices, cameras: int) -> None:
        eye, point = np.nonzero(np.isfinite(rays[..., 0]))
        order = np.lexsort((eye // cameras, host[point]))
        self.eye, self.point = eye[order], point[order]
        self.view, self.host = self.eye // cameras, host[self.point]
        self.rays = np.ascontiguousarray(rays[self.eye, self.point].T)
        self._camera = self.eye % cameras
        is_new = np.ones(len(self.eye), bool)
        is_new[1:] = (np.diff(self.host) != 0) | (np.diff(self.view) != 0)
        self._starts = np.flatnonzero(is_new)

    def _seen(self, scene: BundleScene) -> _PredictedSightings:
        R, p = scene.eyes()
        axes = R.transpose(1, 2, 0).take(self.eye, axis=2)
        points = scene.homogeneous().T.take(self.point, axis=1)
        seen = ((points[:3] - points[3] * p.T.take(self.eye, axis=1))[:, None] * axes).sum(axis=0)
        is_valid: Mask = seen[2] > NEAR
        depth = np.where(is_valid, seen[2], 1.0)
        residuals = np.where(is_valid, self.rays - seen[:2] / depth, 0.0)
        return _PredictedSightings(residuals, depth, is_valid, axes, points)

    def normal(self, scene: BundleScene, sigma: float, alike: float = 1.0) -> BundleEquations:
        """The normal equations at the poses and points of a scene.

        Args:
            sigma: standard deviation of directions.
            alike: sightings that are as good as an independent one.
        """
        r, depth, is_valid, axes, (x, y, z, rho) = self._seen(scene)
        off = np.sqrt((r * r).sum(axis=0)) / sigma
        w = np.sqrt(np.minimum(1.0, HUBER / np.maximum(off, 1e-9)) / alike) / sigma
        cost = np.where(off < HUBER, off**2 / 2, HUBER * (off - HUBER / 2)).sum() / alike
        flat = (axes[:, :2] - (self.rays - r) * axes[:, 2:]) * (is_valid * w / depth)
        J = np.empty((7, *r.shape))  # by the twist of the view; the residual
        J[:3] = -rho * flat
        J[3] = flat[1] * z - flat[2] * y
        J[4] = flat[2] * x - flat[0] * z
        J[5] = flat[0] * y - flat[1] * x
        J[6] = r * w
        way = scene.p.T.take(self.host, axis=1) - scene.eyes()[1].T.take(self.eye, axis=1)
        across = scene.R.transpose(2, 1, 0)[:2].take(self.host, axis=2)
        B = np.stack([(flat * one[:, None]).sum(axis=0) for one in (*across, way)])
        H, g = self._of_views(J, len(scene.R))
        return BundleEquations(self, scene, H, g, J, B, float(cost))

    def _of_views(self, J: Floats, views: int) -> tuple[Floats, Floats]:
        """H (6 F, 6 F) and g (6 F,) by derivatives and residuals (7, 2, N)."""
        each = np.einsum("ian,jan->ijn", J[:6], J)
        pairs = np.zeros((views, views, 6, 7))  # of hosts and views
        sums = np.add.reduceat(each, self._starts, axis=2).transpose(2, 0, 1)
        pairs[self.host[self._starts], self.view[self._starts]] = sums
        across = pairs[..., :6] + pairs[..., :6].swapaxes(0, 1)
        H = -across
        every = np.arange(views)
        H[every, every] += across.sum(axis=1)
        g = pairs[..., 6].sum(axis=0) - pairs[..., 6].sum(axis=1)
        return H.swapaxes(1, 2).reshape(6 * views, 6 * views), g.ravel()

    def between(self, A: Floats, B: Floats, host: Indices, views: int) -> Floats:
        """(6 F, 3 P) sums of A' B, by views A (6, 2, N) and by points B (3, 2, N)."""
        each = A[:, None, 0] * B[:, 0] + A[:, None, 1] * B[:, 1]
        found = np.zeros((18, views * len(host)))
        at = self.view * len(host) + self.point
        for camera in range(self._camera.max(initial=0) + 1):  # a view's cameras share its place
            own = self._camera == camera
            found[:, at[own]] += each.reshape(18, -1)[:, own]
        sums = found.reshape(18, views, -1).sum(axis=1)
        found[:, host * len(host) + np.arange(len(host))] -= sums
        blocks: Floats = found.reshape(6, 3, views, -1).transpose(2, 0, 1, 3)
        return blocks.reshape(6 * views, -1)


class _PredictedSightings(NamedTuple):
    """Sightings from the poses of a scene: axes (3, 3, N) of cameras, points (4, N) in the map."""

    residuals: Floats
    depth: Floats
    is_valid: Mask
    axes: Floats
    points: Floats


@dataclass(frozen=True, eq=False)
class BundleEquations:
    """Normal equations of views and points: H x = g.

    Attributes:
        sightings, scene: what the equations were made from.
        H, g: (6 F, 6 F) and (6 F,) of the views.
        J: (7, 2, N) weighted derivatives by the twist of the view (those by the twist of the host
            are their negatives), and weighted residuals.
        B: (3, 2, N) weighted derivatives by the point.
        cost: half of the sum of squares.
    """

    sightings: Sightings
    scene: BundleScene
    H: Floats
    g: Floats
    J: Floats
    B: Floats
    cost: float

    def reduced(self, damping: float) -> ReducedEquations:
        """The equations of the views alone."""
        at, host, B, r = self.sightings.point, self.scene.host, self.B, self.J[6]

        def summed(products: Floats) -> Floats:
            found: Floats = np.bincount(at, products.sum(axis=0), len(host)).astype(np.float64)
            return found

        L = np.zeros((3, 3, len(host)))
        C = np.empty_like(B)  # B inv(L)'
        for i in range(3):
            for j in range(i + 1):
                left = summed(B[i] * B[j]) - (L[i, :j] * L[j, :j]).sum(axis=0)
                if i == j:
                    more = damping * summed(B[i] * B[i]) + _LEAST
                    left = np.sqrt(np.maximum(left + more, _LEAST))
                L[i, j] = left if i == j else left / L[j, j]
            C[i] = (B[i] - (L[i, :i].take(at, axis=1)[:, None] * C[:i]).sum(axis=0)) / L[i, i].take(
                at
            )
        U = self.sightings.between(self.J[:6], C, host, len(self.scene.R))
        y = np.stack([summed(one * r) for one in C])
        return ReducedEquations(self.H - U @ U.T, self.g - U @ y.ravel(), U, y, L)


class ReducedEquations(NamedTuple):
    """Normal equations of views without points.

    Attributes:
        H, g: (6 F, 6 F) and (6 F,).
        U, y, L: what was eliminated, (6 F, 3 P), (3, P) and (3, 3, P).
    """

    H: Floats
    g: Floats
    U: Floats
    y: Floats
    L: Floats

    def points_of(self, x: Floats) -> Floats:
        """(P, 3) changes of points after the views were moved by x (6 F,)."""
        found = self.y - (x @ self.U).reshape(3, -1)
        for i in (2, 1, 0):
            found[i] -= (self.L[i + 1 :, i] * found[i + 1 :]).sum(axis=0)
            found[i] /= self.L[i, i]
        changes: Floats = found.T
        return changes
