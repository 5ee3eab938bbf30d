"""A start in motion: velocity and gravity by one or two seconds of images and IMU.

With rotations by the gyroscope, a corner at X is seen from where the robot has flown, fallen and
been pushed, ``c = v t + g t^2 / 2 + s``. Velocity, gravity and all X would solve linear equations
(`Martinelli`), whose noise makes the scale too small wherever accelerations show it badly. So these
are solved at several mean depths only to begin with; what is seen in the images is then fitted, as
in a bundle adjustment. Errors of the IMU, and of the camera's clock, attitude, its age and lens are
unknown within their standard deviations, so the covariance of the velocity includes them. On a
gimbal, the attitude errs differently in each image, and with it all corners there. So each view has
an attitude of its own, with the correlations that the filter assumes; with one for all, velocities
were up to 10 standard deviations off. Only a velocity that is well known is taken. The filter
begins with much more uncertainty than that at the first of these images, and sees them all, so they
hardly count twice.

Source: A. Martinelli, Closed-form solution of visual-inertial structure from motion, IJCV 2014;
T. Dong-Si, A. Mourikis, Estimator initialization in vision-aided inertial navigation with unknown
camera-IMU calibration, IROS 2012 (the fit).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.imu import ImuBuffer, ImuIntervals
from ros_visualise.estimation.inertial.filter import InertialSettings
from ros_visualise.estimation.inertial.jumps import turned
from ros_visualise.estimation.inertial.lens import corrected, first_lens, shifts_of
from ros_visualise.estimation.inertial.readout import slips_of
from ros_visualise.estimation.inertial.sliding import FORCE_BIAS, MOTION, RATE_BIAS
from ros_visualise.estimation.inertial.starting import FirstEstimate, SeenCorners, level
from ros_visualise.estimation.resting import Indices
from ros_visualise.estimation.robot import GRAVITY_MS2, RobotState
from ros_visualise.estimation.settings import CameraErrors
from ros_visualise.estimation.visual.bundle import Mask
from ros_visualise.geometry import se3

_LEAST_CORNERS, _MOST_CORNERS, _LEAST_VIEWS = 15, 80, 6
_ALIKE = 3.0  # times the standard deviation of directions: corners of an image err alike
_TILT, _SPEED, _PART = 0.1, 0.3, 0.3  # of the start: rad, m/s, and a part of the velocity
_LEAST_EXCITATION = 0.1  # m
_KNOWN = 0.4  # of these: standard deviation of what is taken
_DEPTHS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # m, means that are tried
_STEPS, _DONE = 8, 1e-3
_LONGEST = 1.0  # of a step, in what is allowed
_AS_GOOD = 1.1  # misfits of two solutions that are not told apart
_NEAREST = 0.05  # m
_GRAVITY_SIGMA = 0.02  # m/s^2, of its length
_MOTION, _LENS, _SHARED = 6, slice(14, 18), 18  # numbers: velocity, gravity; biases of force and
# rates, clock, age; lens; then the attitudes of the camera, which differ from view to view
_LEAST_MISFIT = 0.3  # standard deviations of directions
_SMALL = 1e-4  # steps by which derivatives are computed


class _Solution(NamedTuple):
    """The unknowns (18 + 3 K,) of a fit, its misfit in standard deviations of directions, and the
    covariance of those that were free.
    """

    x: Floats
    sigma: float
    P: Floats


class _Window:
    """Corners (N, K) in views, and the IMU between these; positions are in the robot's axes at the
    first view.
    """

    def __init__(
        self,
        views: Sequence[SeenCorners],
        parts: Sequence[ImuIntervals],
        settings: InertialSettings,
    ) -> None:
        self.views, self.parts, self.noise = views, parts, settings.noise
        self.root = _root(views, settings.camera)
        ids, counts = np.unique(np.concatenate([one.ids for one in views]), return_counts=True)
        ids = ids[counts >= _LEAST_VIEWS]
        ids = ids[:: len(ids) // _MOST_CORNERS + 1]
        self.rays = np.zeros((len(ids), len(views), 2))
        self.slips = np.zeros((len(ids), len(views), 2, 2))
        self.seen = np.zeros((len(ids), len(views)), bool)
        for k, view in enumerate(views):
            kept = np.isin(view.ids, ids)
            n = np.searchsorted(ids, view.ids[kept])
            self.seen[n, k] = True
            self.rays[n, k] = view.rays[kept]
            self.slips[n, k] = slips_of(np.pad(view.rolling[kept], [(0, 0), (0, 2)]))
        self._falls: dict[bytes, tuple[Floats, ...]] = {}

    def pushed(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Times, and ways and velocities by pushes alone."""
        seconds, _, _, way, speed = self._fallen(x[6:9], x[9:12])
        return seconds, way, speed

    def excitation(self, x: Floats) -> float:
        """Distance (rms, m) by which accelerations bend the path: only that shows the scale."""
        seconds, way, _ = self.pushed(x)
        path = way + seconds[:, None] ** 2 / 2 * x[3:6]
        even = np.column_stack([np.ones_like(seconds), seconds])
        bent = path - even @ np.linalg.lstsq(even, path, rcond=None)[0]
        return float(np.sqrt((bent**2).sum(axis=1).mean()))

    def _fallen(self, force_bias: Floats, rate_bias: Floats) -> tuple[Floats, ...]:
        """Time, attitude, angular velocity, and way and velocity by pushes alone, of each view."""
        key = np.concatenate([force_bias, rate_bias]).tobytes()
        if key not in self._falls:
            R, v, p, seconds = np.eye(3), np.zeros(3), np.zeros(3), 0.0
            found = [(0.0, R, self.parts[0][0].rates - rate_bias, p, v)]
            for several in self.parts:
                for one in several:
                    turn = (one.rates - rate_bias) * one.seconds / 2
                    half = se3.exp(np.append(np.zeros(3), turn))[0]
                    push = R @ half @ (one.force - force_bias)
                    p = p + v * one.seconds + push * one.seconds**2 / 2
                    v, R = v + push * one.seconds, R @ half @ half
                    seconds += one.seconds
                found.append((seconds, R, R @ (several[-1].rates - rate_bias), p, v))
            self._falls[key] = tuple(np.array(one) for one in zip(*found, strict=True))
        return self._falls[key]

    def cameras(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Attitudes (K, 3, 3) and positions (K, 3) of the camera, and times (K,) of views."""
        v, g, force, rate = x[:12].reshape(4, 3)
        late, age = x[12:14]
        turns = self.root @ x[_SHARED:].reshape(-1, 3)
        seconds, R, rates, way, speed = self._fallen(force, rate)
        seconds = seconds + late
        found = []
        for k, view in enumerate(self.views):
            base = se3.exp(np.append(np.zeros(3), late * rates[k]))[0] @ R[k]
            mount = se3.exp(np.append(np.zeros(3), (late + age) * view.turning + turns[k]))[0]
            found.append((base @ view.T_base_camera[:3, :3] @ mount,
                          way[k] + late * speed[k] + base @ view.T_base_camera[:3, 3]))  # fmt: skip
        C, at = (np.array(one) for one in zip(*found, strict=True))
        return C, at + seconds[:, None] * v + seconds[:, None] ** 2 / 2 * g, seconds


def start_in_motion(
    imu: ImuBuffer, views: Sequence[SeenCorners], settings: InertialSettings
) -> FirstEstimate | None:
    """The robot at the first of some views; None if they do not show its velocity well."""
    parts = [imu.between(a.stamp_ns, b.stamp_ns) for a, b in pairwise(views)]
    known = [one for one in parts if one]
    if len(known) < max(len(parts), _LEAST_VIEWS):
        return None
    window = _Window(views, known, settings)
    if len(window.rays) < _LEAST_CORNERS:
        return None
    found = _solved(window, settings)
    if found is None:
        return None
    v, g = found.x[:3], found.x[3:6]
    allowed = _allowed(v)
    if window.excitation(found.x) < _LEAST_EXCITATION:
        return None
    sigmas = np.sqrt(np.diag(found.P))
    if sigmas[:3].max() > _KNOWN * allowed or sigmas[3:6].max() > _KNOWN * _TILT * GRAVITY_MS2:
        return None
    R = level(-g)
    errors = np.zeros(15)
    errors[[3, 4]], errors[MOTION] = _TILT, allowed
    errors[RATE_BIAS], errors[FORCE_BIAS] = settings.imu.gyro_bias, settings.imu.accel_bias
    return FirstEstimate(views[0].stamp_ns, RobotState(R=R, v=R @ v), np.diag(errors**2))


def _root(views: Sequence[SeenCorners], camera: CameraErrors) -> Floats:
    """A root (K, K) of the covariance of the camera's attitude in the views, about each axis."""
    times = np.array([one.stamp_ns for one in views]) / 1e9
    apart = np.abs(times[:, None] - times) / (camera.turn_s or np.inf)
    values, vectors = np.linalg.eigh(camera.turn_rad**2 * np.exp(-apart))
    root: Floats = vectors * np.sqrt(np.maximum(values, 0))
    return root


def _priors(settings: InertialSettings, views: int) -> tuple[Floats, Floats]:
    """Expected values (18 + 3 K,) of all unknowns, and standard deviations."""
    own = settings.imu
    x, sigmas = np.zeros((2, _SHARED + 3 * views))
    x[_LENS], covariance = first_lens(settings.readout, settings.camera)
    sigmas[:_MOTION], sigmas[_SHARED:] = np.inf, 1.0
    sigmas[6:12] = np.repeat([own.accel_bias, own.gyro_bias], 3)
    sigmas[12:14] = settings.camera.clock_s, settings.age_s
    sigmas[_LENS] = np.sqrt(np.diag(covariance))
    return x, sigmas


def _solved(window: _Window, settings: InertialSettings) -> _Solution | None:
    """The solution that fits best; None if another one fits as well."""
    expected, sigmas = _priors(settings, len(window.views))
    every = np.arange(len(expected))
    first = np.delete(every, slice(_MOTION, _SHARED))
    found: list[_Solution] = []
    for start in _starts(window, expected):
        one = _fitted(window, start, expected, sigmas, first)
        if one is not None and not any(_is_same(one, other) for other in found):
            found.append(one)
    refined = [_fitted(window, one.x, expected, sigmas, every) for one in found]
    good = sorted((one for one in refined if one is not None), key=lambda one: one.sigma)
    if any(one.sigma < _AS_GOOD * good[0].sigma and not _is_same(one, good[0]) for one in good[1:]):
        return None
    return good[0] if good else None


def _is_same(one: _Solution, other: _Solution) -> bool:
    off = np.linalg.norm(one.x[:3] - other.x[:3])
    return bool(off < _allowed(one.x[:3]) / 3)


def _allowed(v: Floats) -> float:
    """Standard deviation of a velocity (3,) with which the filter begins."""
    return _SPEED + _PART * float(np.linalg.norm(v))


def _starts(window: _Window, expected: Floats) -> list[Floats]:
    """Solutions of the linear equations at several mean depths, gravity against the mean push."""
    x = expected.copy()
    speed = window.pushed(x)[-1]
    x[3:6] = -speed[-1] / np.linalg.norm(speed[-1]) * GRAVITY_MS2
    C, at, seconds = window.cameras(x)  # at rest before
    A = _across(C, corrected(window.rays, window.slips, x[_LENS])) * window.seen[..., None, None]
    H = (-A * seconds[:, None, None]).reshape(len(A), -1, 3)
    b = (A @ at[..., None]).reshape(len(A), -1, 1)
    A = A.reshape(len(A), -1, 3)
    both = np.concatenate([H, b], axis=2)
    positions = np.linalg.pinv(A) @ both
    rows = (both - A @ positions).reshape(-1, 4)
    N, y = rows[:, :3].T @ rows[:, :3] + 1e-9 * np.eye(3), rows[:, :3].T @ rows[:, 3]
    depth = C[0][:, 2] @ positions.mean(axis=0)  # at no velocity, less that by its components
    free, along = np.linalg.solve(N, y), np.linalg.solve(N, -depth[:3])
    found = []
    for wanted in _DEPTHS:
        x[:3] = free + along * (wanted - depth[3] + depth[:3] @ free) / (-depth[:3] @ along)
        found.append(x.copy())
    return found


def _fitted(
    window: _Window, x: Floats, expected: Floats, sigmas: Floats, free: Indices
) -> _Solution | None:
    """The unknowns, these of them free, that fit what the images show."""
    x, sigma, P = x.copy(), np.inf, np.eye(len(free))
    is_known = np.isfinite(sigmas[free])
    scale = np.where(is_known, sigmas[free], 1.0)  # one scale for all, or `pinv` drops unknowns
    for _ in range(_STEPS):
        found = _linearized(window, x, free)
        if found is None:
            return None
        rows, sigma = found
        length = float(np.linalg.norm(x[3:6]))
        down, off = np.zeros(len(free)), (length - GRAVITY_MS2) / _GRAVITY_SIGMA
        down[3:6] = x[3:6] / length / _GRAVITY_SIGMA
        J, change = rows[:, :-1] * scale, (x - expected)[free]
        change = np.divide(change, scale, np.zeros(len(free)), where=is_known & (scale > 0))
        P = np.linalg.pinv(J.T @ J + np.diag(is_known * 1.0) + np.outer(down, down), hermitian=True)
        step = -scale * (P @ (J.T @ rows[:, -1] + change + down * off))
        far = float(np.abs(step[:3]).max())
        x[free] += step * min(1.0, _LONGEST * _allowed(x[:3]) / max(far, 1e-12))
        if np.abs(step[:_MOTION]).max() < _DONE:
            break
    return _Solution(x, sigma, P * np.outer(scale, scale))


def _linearized(window: _Window, x: Floats, free: Indices) -> tuple[Floats, float] | None:
    """Derivatives by the free unknowns, and what is seen too far, (k, F + 1), in standard
    deviations and without positions of corners; and the misfit.
    """
    C, at, seconds = window.cameras(x)
    rays = corrected(window.rays, window.slips, x[_LENS])
    points = _triangulated(C, at, rays, window.seen)
    residual, by_point, good = _seen(C, at, rays, points, window.seen)
    if good.sum() < _LEAST_CORNERS:
        return None
    J, expected = np.zeros((*residual.shape, len(x))), residual + rays
    J[..., :3] = -by_point * seconds[:, None, None]
    J[..., 3:6] = -by_point * (seconds[:, None, None] ** 2 / 2)
    for n in range(_MOTION, _LENS.start if len(free) == len(x) else _MOTION):
        other = x.copy()
        other[n] += _SMALL
        moved = _seen(*window.cameras(other)[:2], rays, points, window.seen)[0]
        J[..., n] = (moved - residual) / _SMALL
    J[..., _LENS] = shifts_of(expected, window.slips)
    by_turns = turned(expected)[..., None, :] * window.root[:, None, :, None]
    J[..., _SHARED:] = by_turns.reshape(*residual.shape, -1)
    J *= window.seen[..., None, None]
    rows = np.concatenate([by_point, J[..., free], residual[..., None]], axis=3)[good]
    rows = window.noise.whitened(rows, window.seen[good]).reshape(len(rows), -1, rows.shape[3])
    A, rows = rows[..., :3], rows[..., 3:]
    rows = rows - A @ (np.linalg.pinv(A) @ rows)
    excess = 2 * window.seen[good].sum(axis=1) - 3
    fits = np.sqrt((rows[..., -1] ** 2).sum(axis=1) / excess)
    sigma = max(float(np.median(fits)), _LEAST_MISFIT)
    weights = 1 / (_ALIKE * sigma) / np.sqrt(1 + (fits / (3 * sigma)) ** 2)
    return (rows * weights[:, None, None]).reshape(-1, len(free) + 1), sigma


def _triangulated(C: Floats, at: Floats, rays: Floats, seen: Floats) -> Floats:
    """(N, 3) positions of corners: linear, then by what is seen."""
    across = _across(C, rays)
    weight = seen[..., None, None].astype(float)
    points = np.zeros((len(rays), 3))
    for _ in range(3):
        A = (across * weight).reshape(len(rays), -1, 3)
        b = ((across * weight) @ at[..., None]).reshape(len(rays), -1)
        back = np.swapaxes(A, 1, 2)
        points = (np.linalg.pinv(back @ A, hermitian=True) @ (back @ b[..., None]))[..., 0]
        depth = np.einsum("nkj,kj->nk", points[:, None] - at, C[:, :, 2])
        weight = (seen / np.maximum(np.abs(depth), _NEAREST))[..., None, None]
    return points


def _across(C: Floats, rays: Floats) -> Floats:
    """(N, K, 2, 3) derivatives of how far a position is from rays, times its depth."""
    across: Floats = C.transpose(0, 2, 1)[None, :, :2] - rays[..., None] * C[None, :, None, :, 2]
    return across


def _seen(
    C: Floats, at: Floats, rays: Floats, points: Floats, seen: Floats
) -> tuple[Floats, Floats, Mask]:
    """Expected minus measured directions (N, K, 2), derivatives (N, K, 2, 3) by positions, and
    which corners lie in front of all views.
    """
    away = np.einsum("kji,nkj->nki", C, points[:, None] - at)
    z = np.where(seen, away[..., 2], 1.0)
    good = np.asarray((z > _NEAREST).all(axis=1))
    z = np.maximum(z, _NEAREST)
    expected = away[..., :2] / z[..., None]
    J = _across(C, expected) / z[..., None, None] * seen[..., None, None]
    return (expected - rays) * seen[..., None], J, good
