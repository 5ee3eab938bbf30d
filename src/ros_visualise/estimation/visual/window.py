"""The last keyframes of a camera, with the points that they see, and what is known from before.

The views before are eliminated, with the points that they host: what these sightings tell of the
views that stay is a prior on their poses, so the covariance of the newest pose counts all drift
since the start. Distances between keyframes that something else measures (the height over the
ground, wheels, GPS) are part of the adjustment.

Source: G. Sibley, L. Matthies, G. Sukhatme, Sliding window filter with application to planetary
landing, 2010; S. Leutenegger et al., Keyframe-based visual-inertial odometry using nonlinear
optimization, IJRR 2015.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.visual.bundle import (
    HUBER,
    BundleScene,
    project,
    triangulated,
)
from ros_visualise.estimation.visual.equations import BundleEquations, Sightings
from ros_visualise.estimation.visual.keyframes import (
    Keyframe,
    KeyframeDistance,
    MapPoints,
    PosePrior,
)
from ros_visualise.estimation.visual.locating import ALIKE, OUTLIER, Located, locate, orthogonal
from ros_visualise.geometry import se3
from ros_visualise.vision.tracking import Ids

_STEPS, _STEPS_AGAIN = 4, 2  # the second time, after outliers were dropped
_FEW = 0.02  # of the sightings, outliers after which poses are not adjusted again
_CONVERGED = 1e-2  # of the cost
_LEAST_HELD = 4  # points of a keyframe, after outliers were dropped
_START = 1e-4  # standard deviation of the first pose, m and rad: the map begins there
_FAR = 1e-6


class KeyframeWindow:
    """See the module.

    Args:
        sigma: standard deviation of directions.
        cameras: T_left_camera (C, 4, 4).
        length: number of keyframes.

    Attributes:
        lost: ids of points that the last adjustment dropped.
        residual: robust standard deviation of the sightings' residuals then, as a direction.
    """

    def __init__(self, sigma: float, cameras: Floats, length: int = 8) -> None:
        self.sigma, self.cameras, self.length = sigma, cameras, length
        self.frames: list[Keyframe] = []
        self.points = MapPoints()
        self.distances: list[KeyframeDistance] = []
        self.prior: PosePrior | None = None
        self.lost: Ids = np.zeros(0, np.int64)
        self.residual = sigma

    @property
    def newest(self) -> Keyframe:
        """The last keyframe."""
        return self.frames[-1]

    def frame(self, key: int) -> Keyframe:
        """A keyframe."""
        return next(one for one in self.frames if one.key == key)

    def add(self, frame: Keyframe) -> None:
        """Add a keyframe, and the points that are known by it."""
        self.frames.append(frame)
        if self.prior is None:
            H = np.eye(6) / _START**2
            self.prior = PosePrior([frame.key], frame.R[None], frame.p[None], H, np.zeros(6))
        self._add_points()

    def _add_points(self) -> None:
        """Points whose depths the newest keyframe and another one show."""
        new = self.newest
        for first in self.frames:
            for camera in range(len(self.cameras)):
                if first is new and camera == 0:
                    continue
                self._triangulate(first, new, camera)

    def _triangulate(self, first: Keyframe, new: Keyframe, camera: int) -> None:
        common, a, b = np.intersect1d(first.ids, new.ids, return_indices=True)
        z0, z1 = first.rays[0, a], new.rays[camera, b]
        fresh = ~np.isin(common, self.points.ids) & np.isfinite(z0[:, 0]) & np.isfinite(z1[:, 0])
        if not fresh.any():
            return
        T = self.cameras[camera]
        R_view, p_view = new.R @ T[:3, :3], new.p + new.R @ T[:3, 3]
        R, p = R_view.T @ first.R, R_view.T @ (first.p - p_view)
        rho, factor = triangulated(R, p, z0[fresh], z1[fresh])
        scale = 1 / max(float(np.linalg.norm(p)), 1e-9)
        off = factor * self.sigma
        good = (rho > -2 * off) & (off < 0.2 * scale)
        values = np.column_stack([z0[fresh], np.maximum(rho, _FAR)])[good]
        ids = common[fresh][good]
        self.points = self.points.joined(MapPoints(ids, np.full(len(ids), first.key), values))

    def positions(self) -> Floats:
        """(N, 3) the points, in the map."""
        points = self.scene().homogeneous()
        found: Floats = points[:, :3] / points[:, 3:]
        return found

    # adjustment

    def scene(self) -> BundleScene:
        """Views and points, as the adjustment takes them."""
        keys = np.array([one.key for one in self.frames])
        R = np.array([one.R for one in self.frames])
        p = np.array([one.p for one in self.frames])
        return BundleScene(
            R, p, np.searchsorted(keys, self.points.host), self.points.values, self.cameras
        )

    def sightings(self) -> Floats:
        """(F C, P, 2) directions in which all cameras see the points; NaN where they do not."""
        seen = np.full((len(self.frames), len(self.cameras), len(self.points.ids), 2), np.nan)
        for place, one in enumerate(self.frames):
            at = np.searchsorted(one.ids, self.points.ids).clip(0, len(one.ids) - 1)
            known = one.ids[at] == self.points.ids
            seen[place][:, known] = one.rays[:, at[known]]
        return seen.reshape(-1, len(self.points.ids), 2)

    def adjust(self) -> bool:
        """Fit poses and points to their sightings; drop outliers, whose ids are ``lost`` then.

        False if a keyframe is left without points, which makes its pose unknown.
        """
        self.lost = np.zeros(0, np.int64)
        seen = self.sightings()
        for steps in (_STEPS, _STEPS_AGAIN):
            self._minimise(seen, steps)
            every = int(np.isfinite(seen[..., 0]).sum())
            seen, dropped = self._without_outliers(seen)
            if dropped and not self._is_held(seen):
                return False
            if dropped <= _FEW * every:
                break
        return True

    def _is_held(self, seen: Floats) -> bool:
        """True if each keyframe sees points, or is known from before."""
        each = np.isfinite(seen[..., 0]).sum(axis=1).reshape(len(self.frames), -1).sum(axis=1)
        known = [] if self.prior is None else self.prior.keys
        pairs = zip(each, self.frames, strict=True)
        return all(count >= _LEAST_HELD or one.key in known for count, one in pairs)

    def _minimise(self, seen: Floats, steps: int) -> None:
        """Levenberg's and Marquardt's method."""
        scene = self.scene()
        sightings = self._listed(scene, seen)
        system, damping = self._system(scene, sightings), 1e-4
        for _ in range(steps):
            reduced = system.reduced(damping)
            H = reduced.H + damping * np.diag(np.diag(system.H))
            x = np.asarray(np.linalg.solve(H, reduced.g), np.float64)
            after = scene.moved(x.reshape(-1, 6), reduced.points_of(x))
            then = self._system(after, sightings)
            if then.cost > system.cost:
                damping *= 10
                continue
            is_done = system.cost - then.cost < _CONVERGED * abs(system.cost)
            scene, system, damping = after, then, damping / 10
            if is_done:
                break
        self._take(scene)

    def _take(self, scene: BundleScene) -> None:
        for one, R, p in zip(self.frames, orthogonal(scene.R), scene.p, strict=True):
            one.R, one.p = R, p
        self.points.values = scene.points

    def _listed(self, scene: BundleScene, sightings: Floats) -> Sightings:
        return Sightings(sightings, scene.host, len(self.cameras))

    def _system(self, scene: BundleScene, sightings: Sightings) -> BundleEquations:
        """The normal equations of sightings, distances and what is known from before."""
        found = sightings.normal(scene, self.sigma, ALIKE)
        H, g, cost = found.H, found.g, found.cost
        place = {one.key: n for n, one in enumerate(self.frames)}
        if self.prior is not None:
            at = [place[key] for key in self.prior.keys]
            rows = (6 * np.array(at)[:, None] + np.arange(6)).ravel()
            right, more = self.prior.at(scene.R[at], scene.p[at])
            H[np.ix_(rows, rows)] += self.prior.H
            g[rows] += right
            cost += more
        if self.distances:
            J, off, variance = self._by_distances(scene, place)
            far = np.abs(off) / np.sqrt(variance)
            w = np.minimum(1.0, HUBER / np.maximum(far, 1e-9)) / variance
            H += (J.T * w) @ J
            g += J.T @ (w * off)
            cost += float(np.where(far < HUBER, far**2 / 2, HUBER * (far - HUBER / 2)).sum())
        return replace(found, H=H, g=g, cost=cost)

    def _by_distances(
        self, scene: BundleScene, place: dict[int, int]
    ) -> tuple[Floats, Floats, Floats]:
        """Derivatives of the D distances (D, 6 F), measured minus expected, and variances."""
        first = np.array([place[one.first] for one in self.distances])
        second = np.array([place[one.second] for one in self.distances])
        length, sigma = np.array([(one.length, one.sigma) for one in self.distances]).T
        way = scene.p[second] - scene.p[first]
        now = np.linalg.norm(way, axis=1)
        along = way / np.maximum(now, 1e-12)[:, None]
        rows = np.arange(len(way))
        J = np.zeros((len(way), len(scene.p), 6))
        for end, sign in ((first, -1), (second, 1)):
            turned = (se3.cross(scene.p[end]) @ along[..., None])[..., 0]
            J[rows, end] = sign * np.hstack([along, turned])
        return J.reshape(len(way), -1), length - now, sigma**2

    def _without_outliers(self, seen: Floats) -> tuple[Floats, int]:
        """Forget sightings that do not fit, and points without two; what is left, their number."""
        scene = self.scene()
        residuals, _, is_valid = project(scene.homogeneous(), *scene.eyes(), seen)
        good = is_valid & (np.hypot(*np.moveaxis(residuals, 2, 0)) < OUTLIER * self.sigma)
        bad = np.isfinite(seen[..., 0]) & ~good
        cameras = len(self.cameras)
        for place, camera in zip(*np.divmod(np.flatnonzero(bad.any(axis=1)), cameras), strict=True):
            one, these = self.frames[place], bad[place * cameras + camera]
            one.rays[camera, np.searchsorted(one.ids, self.points.ids[these])] = np.nan
        by_host = scene.host * cameras, np.arange(len(scene.host))
        kept = (good.sum(axis=0) >= 2) & good[by_host]
        good[by_host] = False
        if good.any():
            self.residual = float(np.median(np.abs(residuals[good])) / 0.6745)
        self.lost = np.concatenate([self.lost, self.points.ids[~kept]])
        self.points = self.points.chosen(kept)
        return np.where(bad[..., None], np.nan, seen)[:, kept], int(bad.sum())

    def covariance(self, seen: Floats) -> Floats:
        """(6, 6) covariance of the twist of the newest keyframe, by the `sightings`."""
        scene = self.scene()
        H = self._system(scene, self._listed(scene, seen)).reduced(0.0).H
        scale = 1 / np.sqrt(np.diag(H))
        newest = np.eye(len(H))[:, -6:]
        found = np.linalg.solve(H * np.multiply.outer(scale, scale), newest)[-6:]
        covariance: Floats = (found + found.T) / 2 * np.multiply.outer(scale[-6:], scale[-6:])
        return covariance

    def locate(self, R: Floats, p: Floats, ids: Ids, rays: Floats) -> Located | None:
        """The pose from which corners are seen in these directions (N, 2), from a guess on."""
        _, at, of = np.intersect1d(self.points.ids, ids, True, return_indices=True)
        return locate(self.scene().homogeneous()[at], R, p, rays[of], self.sigma)

    # the oldest

    def slide(self, seen: Floats) -> Keyframe | None:
        """Eliminate the oldest keyframe if there are too many, with its `sightings`; it."""
        if len(self.frames) <= self.length:
            return None
        oldest, newest = self.frames[0], self.newest
        scene = self.scene()
        hosted = scene.host == 0
        ids = self.points.ids[hosted]
        part = seen[:, hosted]
        part[-len(self.cameras) :] = np.nan  # the newest keyframe goes on with these points
        few = BundleScene(scene.R, scene.p, scene.host[hosted], scene.points[hosted], self.cameras)
        kept = [one for one in self.distances if oldest.key not in one[:2]]
        self.distances = [one for one in self.distances if oldest.key in one[:2]]
        system = self._system(few, self._listed(few, part)).reduced(0.0)
        self.distances = kept
        self._reduce(system.H, system.g)
        self._rehost(oldest, newest, ids)
        self.frames.pop(0)
        return oldest

    def _reduce(self, H: Floats, g: Floats) -> None:
        """Eliminate the first keyframe from normal equations, which become the prior."""
        own = H[:6, :6] + 1e-12 * np.trace(H[:6, :6]) * np.eye(6)
        gain = np.linalg.solve(own, H[:6, 6:]).T
        rest = H[6:, 6:] - gain @ H[:6, 6:]
        left = self.frames[1:]
        self.prior = PosePrior(
            [one.key for one in left],
            np.array([one.R for one in left]),
            np.array([one.p for one in left]),
            (rest + rest.T) / 2,
            g[6:] - gain @ g[:6],
        )

    def _rehost(self, oldest: Keyframe, newest: Keyframe, ids: Ids) -> None:
        """Continue points of the oldest keyframe from the newest one, if that sees them."""
        mine = np.isin(self.points.ids, ids)
        old, self.points = self.points.chosen(mine), self.points.chosen(~mine)
        for one in self.frames[1:-1]:
            one.rays[:, np.isin(one.ids, ids)] = np.nan
        common, a, b = np.intersect1d(old.ids, newest.ids, return_indices=True)
        R, p = newest.R.T @ oldest.R, newest.R.T @ (oldest.p - newest.p)
        uv, rho = old.values[a, :2], old.values[a, 2]
        far = uv @ R[:, :2].T + R[:, 2] + rho[:, None] * p
        rays = newest.rays[0, b]
        good = (far[:, 2] > _FAR) & np.isfinite(rays[:, 0])
        values = np.column_stack([rays, rho / np.where(good, far[:, 2], 1)])[good]
        n = len(values)
        self.points = self.points.joined(MapPoints(common[good], np.full(n, newest.key), values))

    # units and origin

    def scale(self, factor: float) -> None:
        """Multiply all lengths."""
        for one in self.frames:
            one.p = one.p * factor
        self.points.values[:, 2] /= factor
        self.distances = [
            one._replace(length=one.length * factor, sigma=one.sigma * factor)
            for one in self.distances
        ]
        if self.prior is not None:
            by = np.tile(np.repeat([1 / factor, 1.0], 3), len(self.prior.keys))
            self.prior.p = self.prior.p * factor
            self.prior.H = by[:, None] * self.prior.H * by
            self.prior.g = by * self.prior.g

    def shift(self, by: Floats) -> None:
        """Move the origin of the map, so that all positions change by (3,)."""
        for one in self.frames:
            one.p = one.p + by
        if self.prior is not None:
            back = np.kron(np.eye(len(self.prior.keys)), se3.adjoint(np.eye(3), -by))
            self.prior.p = self.prior.p + by
            self.prior.H = back.T @ self.prior.H @ back
            self.prior.g = back.T @ self.prior.g
