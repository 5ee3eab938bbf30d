"""Corners that were seen from several views, and what they tell of these.

The position of a corner is unknown: what its sightings tell of the views alone is left when they
are projected on the null space of their derivatives by the position.

Source: A. Mourikis, S. Roumeliotis, A multi-state constraint Kalman filter for vision-aided
inertial navigation, ICRA 2007, section III.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.inertial import lens
from ros_visualise.estimation.inertial.readout import slips_of
from ros_visualise.estimation.inertial.sliding import CORE, LENS, VIEW, SlidingState
from ros_visualise.estimation.resting import Indices
from ros_visualise.estimation.visual.bundle import BundleScene, Linearized, Mask, linearize
from ros_visualise.vision.tracking import Ids

_STEPS = 4
_FAR = 1e-6  # inverse depth, 1/m
_LONG_S = 0.3  # between views that no longer show a velocity
_EYE = np.eye(4)[None]
_VELOCITIES = np.array([2, 3, 5, 6])  # all, and their parts by jumps


class CornerTracks:
    """Directions of corners in the views.

    Attributes:
        ids: (K,) numbers of the corners, in order.
        seen: (K, C, 2) x and y of their directions at z = 1, NaN where they were not seen.
    """

    def __init__(self) -> None:
        self.ids: Ids = np.zeros(0, np.int64)
        self._all = np.zeros((0, 0, 7))  # directions, velocities, rows, parts of velocities

    @property
    def seen(self) -> Floats:
        """See the class."""
        return self._all[..., :2]

    def slips(self, chosen: Indices) -> Floats:
        """(F, C, 2, 2) of some corners, see `readout`."""
        return slips_of(self._all[chosen, :, 2:])

    def since_last(self, ids: Ids, rays: Floats, seconds: float) -> Floats:
        """(N, 2) velocities of corners since the last view; NaN where it did not see them."""
        moved = np.full(rays.shape, np.nan)
        if self._all.shape[1] and 0 < seconds < _LONG_S:
            _, old, new = np.intersect1d(self.ids, ids, return_indices=True)
            moved[new] = (rays[new] - self.seen[old, -1]) / seconds
        return moved

    def add(self, ids: Ids, rays: Floats, rolling: Floats, seconds: float) -> None:
        """Add a view that sees corners (N,) in directions (N, 2), some time after the last one.

        ``rolling`` (N, 5) as for `slips_of`. The velocities in the last view become means of those
        before and after it.
        """
        ids_all = np.union1d(self.ids, ids)
        every = np.full((len(ids_all), self._all.shape[1] + 1, 7), np.nan)
        every[np.searchsorted(ids_all, self.ids), :-1] = self._all
        every[np.searchsorted(ids_all, ids), -1] = np.hstack([rays, rolling])
        self.ids, self._all = ids_all, every
        if every.shape[1] > 1 and 0 < seconds < _LONG_S:
            last, new = every[:, -2], every[:, -1]
            known = np.flatnonzero(np.isfinite(last[:, 0] + new[:, 0]))[:, None]
            last[known, _VELOCITIES] = (last[known, _VELOCITIES] + new[known, _VELOCITIES]) / 2

    def drop_view(self, which: int) -> None:
        """Forget a view, and corners that no other one saw."""
        self._all = np.delete(self._all, which, 1)
        self.keep(self.counts > 0)

    def keep(self, chosen: Mask) -> None:
        """Forget all other corners."""
        self.ids, self._all = self.ids[chosen], self._all[chosen]

    def forget(self, chosen: Mask) -> None:
        """Forget the sightings of corners."""
        self._all[chosen] = np.nan

    @property
    def counts(self) -> Indices:
        """(K,) numbers of views that saw them."""
        counts: Indices = np.isfinite(self.seen[..., 0]).sum(axis=1)
        return counts


class TriangulatedTracks(NamedTuple):
    """F corners with estimated positions.

    Attributes:
        seen: (F, C, 2) as in `CornerTracks`.
        host: (F,) the first view that saw each.
        points: (F, 3) as in `SlidingState`.
        sigma: (F,) standard deviations of the inverse depths, for directions of variance 1.
        misfit: (F,) root mean square of the residuals.
    """

    seen: Floats
    host: Indices
    points: Floats
    sigma: Floats
    misfit: Floats

    def chosen(self, kept: Mask | Indices) -> TriangulatedTracks:
        """Some of them."""
        seen, host, points, sigma, misfit = self
        return TriangulatedTracks(seen[kept], host[kept], points[kept], sigma[kept], misfit[kept])


def triangulate(R: Floats, p: Floats, seen: Floats) -> TriangulatedTracks:
    """Positions of corners (F, C, 2) by least squares, in views T_map_camera (C, 3, 3) and (C, 3).

    A corner that is not in front of all its views has an infinite ``misfit``.
    """
    is_seen = np.isfinite(seen[..., 0])
    host = is_seen.argmax(axis=1)
    points = np.column_stack([seen[np.arange(len(seen)), host], np.zeros(len(seen))])
    points[:, 2] = _first_depths(R, p, seen, host)
    for _ in range(_STEPS):
        H, g = _normal(_dense(R, p, host, points, seen))
        points = points + np.linalg.solve(H, g[..., None])[..., 0]
        points[:, 2] = np.maximum(points[:, 2], _FAR)
    found = _dense(R, p, host, points, seen)
    sigma = np.sqrt(np.linalg.inv(_normal(found)[0])[:, 2, 2])
    squares = (found.residuals**2).sum(axis=(0, 2))
    misfit = np.sqrt(squares / (2 * is_seen.sum(axis=1)))
    misfit[found.is_valid.sum(axis=0) < is_seen.sum(axis=1)] = np.inf
    return TriangulatedTracks(seen, host, points, sigma, misfit)


def _dense(R: Floats, p: Floats, host: Indices, points: Floats, seen: Floats) -> Linearized:
    """Sightings (F, C, 2) linearized; arrays begin with (C, F)."""
    return linearize(BundleScene(R, p, host, points, _EYE), seen.swapaxes(0, 1))


def _first_depths(R: Floats, p: Floats, seen: Floats, host: Indices) -> Floats:
    """(F,) inverse depths, linear if the direction in the host is exact."""
    far = np.concatenate([seen[np.arange(len(seen)), host], np.ones((len(seen), 1))], axis=1)
    turned = np.einsum("cji,fjk,fk->fci", R, R[host], far)
    moved = np.einsum("cji,fcj->fci", R, p[host][:, None] - p)
    by_rho = moved[..., :2] - seen * moved[..., 2:]
    left = seen * turned[..., 2:] - turned[..., :2]
    top, squares = np.nansum(by_rho * left, axis=(1, 2)), np.nansum(by_rho**2, axis=(1, 2))
    rho: Floats = np.maximum(top / np.maximum(squares, 1e-12), _FAR)
    return rho


def _normal(found: Linearized) -> tuple[Floats, Floats]:
    """Normal equations (F, 3, 3) and (F, 3) of points by their sightings."""
    B = np.moveaxis(found.by_point, 0, 1).reshape(found.by_point.shape[1], -1, 3)
    r = found.residuals.swapaxes(0, 1)
    back = np.swapaxes(B, 1, 2)
    g: Floats = (back @ r.reshape(len(B), -1, 1))[..., 0]
    return back @ B + 1e-9 * np.eye(3), g


class CornerNoise(NamedTuple):
    """Standard deviations of directions of corners.

    Attributes:
        white: independent in each view.
        walk: of what is added in each view, as a patch is dragged along from image to image.
    """

    white: float
    walk: float

    def scaled(self, by: float) -> CornerNoise:
        """Larger by a factor."""
        return CornerNoise(self.white * by, self.walk * by)

    def whitened(self, rows: Floats, is_seen: Mask) -> Floats:
        """Rows (F, C, ...) of sightings (F, C), combined so that their noise has variance 1.

        The first sightings come first; rows without a sighting are zero.
        """
        order = np.argsort(~is_seen, axis=1, kind="stable")
        rows = np.take_along_axis(rows, order[:, :, None, None], 1)
        number = np.arange(is_seen.shape[1])
        across = np.minimum(number[:, None], number) * self.walk**2
        covariance = across + np.eye(len(number)) * self.white**2
        back = np.linalg.inv(np.linalg.cholesky(covariance))
        flat = rows.reshape(len(rows), len(number), -1)
        mixed = (back @ flat).reshape(rows.shape)
        mixed[number >= is_seen.sum(axis=1)[:, None]] = 0
        return mixed


class ProjectedTracks(NamedTuple):
    """Equations of F corners: those of C views alone, with noise of variance 1, and the rest.

    Attributes:
        rows: (F,) numbers of independent rows; the others are zero.
        residual, H: (F, 2 C - 3) and (F, 2 C - 3, 4 + 6 C), independent of the positions;
            derivatives by the lens and by the views.
        of_point: (F, 3), (F, 3, 4 + 6 C) and (F, 3, 3): residual, and derivatives by lens and
            views and by the positions, of the rest.
    """

    rows: Indices
    residual: Floats
    H: Floats
    of_point: tuple[Floats, Floats, Floats]

    def since(self, error: Floats) -> ProjectedTracks:
        """The same, with residuals before lens and views were moved by an error (4 + 6 C,)."""
        return self._replace(residual=self.residual + self.H @ error)


def project(
    R: Floats, p: Floats, tracks: TriangulatedTracks, slips: Floats, noise: CornerNoise
) -> ProjectedTracks:
    """Project the sightings of corners, which slip by (F, C, 2, 2)."""
    seen, (count, views) = tracks.seen, tracks.seen.shape[:2]
    is_seen = np.isfinite(seen[..., 0])
    found = _dense(R, p, tracks.host, tracks.points, seen)
    start = 4 + lens.COUNT
    every = np.zeros((count, views, 2, start + VIEW * views))  # residual, by point, lens, views
    every[..., 0] = found.residuals.swapaxes(0, 1)
    expected = (seen - every[..., 0])[is_seen]
    every[..., 1:4] = found.by_point.swapaxes(0, 1)
    every[is_seen, :, 4:start] = lens.shifts_of(expected, slips[is_seen])
    by_views = every[..., start:].reshape(count, views, 2, views, VIEW)
    by_view = found.by_view.swapaxes(0, 1)
    which, view = np.nonzero(is_seen)
    by_views[which, view, :, view] = by_view[which, view]
    by_views[which, view, :, tracks.host[which]] -= by_view[which, view]
    rows = noise.whitened(every, is_seen).reshape(count, 2 * views, -1)
    Q, upper = np.linalg.qr(rows[..., 1:4], mode="complete")
    turned = np.swapaxes(Q, 1, 2) @ rows
    point = turned[:, :3, 0], turned[:, :3, 4:], upper[:, :3]
    rest = turned[:, 3:]
    return ProjectedTracks(2 * is_seen.sum(axis=1) - 3, rest[..., 0], rest[..., 4:], point)


def chi_squared(state: SlidingState, found: ProjectedTracks) -> Floats:
    """(F,) squares of the residuals of corners, by the covariance that the state expects."""
    P = state.P[state.seeing, state.seeing]
    S = found.H @ P @ np.swapaxes(found.H, 1, 2) + np.eye(found.H.shape[1])
    whitened = np.linalg.solve(S, found.residual[..., None])[..., 0]
    chi2: Floats = (found.residual * whitened).sum(axis=1)
    return chi2


def limit(count: Indices, sigmas: float) -> Floats:
    """Quantiles of chi-squared with so many degrees of freedom.

    Source: E. Wilson, M. Hilferty, The distribution of chi-square, 1931.
    """
    part = 2 / (9 * count)
    quantiles: Floats = count * (1 - part + sigmas * np.sqrt(part)) ** 3
    return quantiles


def compressed(H: Floats, residual: Floats) -> tuple[Floats, Floats]:
    """Fewer rows that tell the same, for more rows (k, m) than columns; noise of variance 1."""
    if len(H) <= H.shape[1]:
        return H, residual
    upper: Floats = np.asarray(np.linalg.qr(np.column_stack([H, residual]), mode="r"))
    return upper[: H.shape[1], :-1], upper[: H.shape[1], -1]


def together(found: ProjectedTracks, good: Mask) -> tuple[Floats, Floats]:
    """H (k, 4 + 6 C) and residual (k,) of these corners, in as few rows as possible."""
    H = found.H[good].reshape(-1, found.H.shape[2])
    return compressed(H, found.residual[good].ravel())


def begin_points(
    state: SlidingState,
    tracks: TriangulatedTracks,
    found: ProjectedTracks,
    places: Indices,
    step: Floats,
) -> None:
    """Add corners as points, after a step (4 + 6 C,) of lens and views since they were found.

    Source: M. Li, A. Mourikis, Optimization-based estimator design for vision-aided inertial
    navigation, RSS 2012, section IV (the points); P. Geneva et al., OpenVINS, ICRA 2020.
    """
    residual, H, upper = (one[places] for one in found.of_point)
    back = np.linalg.inv(upper)
    values = tracks.points[places] - (back @ (H @ step - residual)[..., None])[..., 0]
    points = lens.points_of(values, state.lens)
    _, by_point, by_lens = lens.values_of(points, state.lens)
    J = -back @ H  # errors of values by those of lens and views
    J[:, :, : lens.COUNT] -= by_lens
    back_to = np.linalg.inv(by_point)
    J, back = back_to @ J, back_to @ back
    flat = J.reshape(-1, J.shape[2])
    across = flat @ state.P[state.seeing]
    own = across[:, state.seeing] @ flat.T
    for n, one in enumerate(back):
        rows = slice(3 * n, 3 * n + 3)
        own[rows, rows] += one @ one.T
    state.add_points(tracks.host[places], points, across, own)


def correct_by_points(
    state: SlidingState, places: Indices, rays: Floats, slips: Floats, sigma: float
) -> Mask:
    """Correct the state by directions (K, 2) of its points in the newest view; which fit (K,).

    ``slips`` are (K, 2, 2), see `readout`.
    """
    newest = len(state.R) - 1
    values, own, by_lens = lens.values_of(state.points[places], state.lens)
    found = linearize(
        BundleScene(state.R, state.p, state.host[places], values, _EYE),
        np.concatenate([np.full((newest, *rays.shape), np.nan), rays[None]]),
    )
    by_view, by_point = found.by_view[-1], found.by_point[-1]
    H = np.zeros((len(places), 2, len(state.P)))
    H[:, :, LENS] = lens.shifts_of(rays - found.residuals[-1], slips) + by_point @ by_lens
    by_point = by_point @ own
    points = state.rows_of_points(places)
    for n, host in enumerate(state.host[places]):
        H[n, :, points[n]] = by_point[n].T
        start = CORE + VIEW * host
        H[n, :, start : start + VIEW] = -by_view[n]
    start = CORE + VIEW * newest
    H[:, :, start : start + VIEW] += by_view
    H, residual = H / sigma, found.residuals[-1] / sigma
    S = H @ state.P @ np.swapaxes(H, 1, 2) + np.eye(2)
    off = (residual * np.linalg.solve(S, residual[..., None])[..., 0]).sum(axis=1)
    good: Mask = found.is_valid[-1] & (off < limit(np.array(2), 2.0))
    if good.any():
        state.correct(slice(None), H[good].reshape(-1, len(state.P)), residual[good].ravel())
    return good
