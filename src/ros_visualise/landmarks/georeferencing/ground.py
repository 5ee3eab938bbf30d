"""Places on the ground that pixels of a camera show, with their covariances.

Errors of the camera's pose, its lens, the pixel and the ground's height are propagated by central
differences of the second order: at flat angles places are far from normally distributed, and to
first order their covariances would be too small.

Source: M. Norgaard, N. K. Poulsen, O. Ravn, New Developments in State Estimation for Nonlinear
Systems, Automatica 36 (2000), equations 36 and 38.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from ros_visualise.data import CameraInfo, Floats, Hypothesis
from ros_visualise.geometry.se3 import cross, exp
from ros_visualise.landmarks.pose.rays import rays_of

_STEP = np.sqrt(3.0)  # standard deviations; of the normal distribution
_LEAST_SIGMAS = 5.0
"""Angles below the horizon in standard deviations; nearer to it, there is no mean position."""
_EARTH_M = 6371e3
_RAYS, _TURNS, _RISES = 3, 3, 2  # pixel twice and lens; rotation; heights of camera and ground

ABOVE, FLAT, BELOW, NO_RAY = (
    "above the horizon",
    "too close to the horizon",
    "the camera is not above the ground",
    "outside the lens model",
)


class Surface(Protocol):
    """The ground in the map's frame: x east, y north, z up at the map's origin."""

    def meet(self, origins_xyz: Floats, directions_xyz: Floats) -> Floats:
        """(N, 3) first points at which rays meet it; NaN where they do not."""

    def lies_below(self, point_xyz: Floats) -> bool:
        """True if the ground is below a point (3,)."""


@dataclass(frozen=True)
class LevelSurface:
    """Ground at one height, metres, that curves with the Earth."""

    height_m: float = 0.0

    def meet(self, origins_xyz: Floats, directions_xyz: Floats) -> Floats:
        """See `Surface`."""
        x, y, z = np.moveaxis(origins_xyz, -1, 0)
        along = x * directions_xyz[:, 0] + y * directions_xyz[:, 1]
        along += (z + _EARTH_M) * directions_xyz[:, 2]
        product = x**2 + y**2 + (z - self.height_m) * (z + self.height_m + 2 * _EARTH_M)
        with np.errstate(invalid="ignore", divide="ignore"):
            lengths = product / (np.sqrt(along**2 - product) - along)
        lengths[(along >= 0) | (product <= 0)] = np.nan
        met: Floats = origins_xyz + lengths[:, None] * directions_xyz
        return met

    def lies_below(self, point_xyz: Floats) -> bool:
        """See `Surface`."""
        return bool(point_xyz[2] + curvature(point_xyz[:2]) > self.height_m)


def curvature(xy: npt.ArrayLike) -> Floats:
    """Depths of the Earth's surface below the plane that touches it at the origin, (..., 2)."""
    drop: Floats = (np.asarray(xy, np.float64) ** 2).sum(axis=-1) / (2 * _EARTH_M)
    return drop


@dataclass(frozen=True)
class ViewErrors:
    """Standard deviations of a camera's pose and lens, and of the ground.

    Attributes:
        tilt_rad: of rotations about level axes.
        heading_rad: of the rotation about the vertical.
        height_m: of the camera's height.
        ground_m: of the ground's.
        lens: of the focal length, as a fraction.
        place_m2: (2, 2) covariance of the camera's position to the east and north.
    """

    tilt_rad: float
    heading_rad: float
    height_m: float
    ground_m: float
    lens: float
    place_m2: Floats


class GroundPoints(NamedTuple):
    """Positions (N, 3) in the map, their covariances (N, 3, 3), and the reasons of those that are
    rejected, which are NaN; else empty.
    """

    positions_xyz: Floats
    covariances_m2: Floats
    rejected: list[str]


def ground_points(
    pixels_uv: Floats,
    covariances_px2: Floats,
    info: CameraInfo,
    T_map_camera: Floats,
    errors: ViewErrors,
    surface: Surface,
) -> GroundPoints:
    """Places on the ground, see above.

    Args:
        pixels_uv: (N, 2), origin at the centre of the top-left pixel.
        covariances_px2: (N, 2, 2) of the pixels.
        info: the camera's calibration.
        T_map_camera: 4x4, of the optical frame.
        errors: of the pose, the lens and the ground.
        surface: the ground.

    Raises:
        UncalibratedCamera, UnsupportedImage: as `rays_of`.
    """
    count = len(pixels_uv)
    if not count:
        return GroundPoints(np.zeros((0, 3)), np.zeros((0, 3, 3)), [])
    origin = T_map_camera[:3, 3]
    directions = _directions(pixels_uv, covariances_px2, info, T_map_camera, errors)
    rises = np.zeros((len(directions), 1))
    shifts = np.zeros((len(directions), 1))
    rises[-4:-2, 0] = _STEP * errors.height_m * np.array([1, -1])
    shifts[-2:, 0] = _STEP * errors.ground_m * np.array([1, -1])
    origins = np.broadcast_to(origin, directions.shape).copy()
    origins[..., 2] += rises - shifts  # higher ground is as a lower camera
    met = surface.meet(origins.reshape(-1, 3), directions.reshape(-1, 3)).reshape(directions.shape)
    met[..., 2] += shifts
    reasons = _reasons(directions, met, surface.lies_below(origin))
    positions, covariances = _moments(met)
    covariances[:, :2, :2] += errors.place_m2
    wrong = np.array([bool(reason) for reason in reasons])
    positions[wrong], covariances[wrong] = np.nan, np.nan
    return GroundPoints(positions, covariances, reasons)


def measured_point(
    hypothesis: Hypothesis, T_map_camera: Floats, errors: ViewErrors
) -> tuple[Floats, Floats]:
    """Position (3,) in the map and covariance (3, 3) of a landmark at a measured distance."""
    R = T_map_camera[:3, :3]
    away = R @ hypothesis.position_xyz
    turned = np.diag([errors.tilt_rad**2, errors.tilt_rad**2, errors.heading_rad**2])
    arm = cross(away)
    covariance = R @ hypothesis.covariance[:3, :3] @ R.T + arm @ turned @ arm.T
    covariance += np.outer(away, away) * errors.lens**2
    covariance[:2, :2] += errors.place_m2
    covariance[2, 2] += errors.height_m**2
    return T_map_camera[:3, 3] + away, covariance


def _directions(
    pixels: Floats, covariances: Floats, info: CameraInfo, T_map_camera: Floats, errors: ViewErrors
) -> Floats:
    """(17, N, 3) of rays in the map: the mean, then two for each error."""
    spread = _STEP * np.linalg.cholesky(covariances + 1e-12 * np.eye(2))
    off_axis = _STEP * errors.lens * (pixels - info.K[:2, 2])
    several = [pixels]
    for shift in (spread[:, :, 0], spread[:, :, 1], off_axis):
        several += [pixels + shift, pixels - shift]
    R = T_map_camera[:3, :3]
    seen = rays_of(np.stack(several), info).directions @ R.T
    mean = seen[0]
    sigmas = (errors.tilt_rad, errors.tilt_rad, errors.heading_rad)
    turns = _STEP * np.diag(sigmas)
    turned = [
        mean @ exp(np.concatenate([np.zeros(3), sign * turn]))[0].T
        for turn in turns
        for sign in (1, -1)
    ]
    return np.concatenate([seen, turned, np.repeat(mean[None], 2 * _RISES, axis=0)])


def _reasons(directions: Floats, met: Floats, is_above: bool) -> list[str]:
    """The reason why each point is rejected; empty: none."""
    below = -np.arcsin(np.clip(directions[..., 2], -1, 1))
    angular = slice(1, 1 + 2 * (_RAYS + _TURNS))
    varied = below[angular]
    sigma = np.sqrt((((varied[::2] - varied[1::2]) / (2 * _STEP)) ** 2).sum(axis=0))
    reasons = []
    for number in range(directions.shape[1]):
        if np.isnan(directions[0, number]).any():
            reasons.append(NO_RAY)
        elif not is_above:
            reasons.append(BELOW)
        elif np.isnan(met[0, number]).any():
            reasons.append(ABOVE)
        elif not below[0, number] > _LEAST_SIGMAS * sigma[number]:
            reasons.append(FLAT)
        else:
            reasons.append(FLAT if np.isnan(met[:, number]).any() else "")
    return reasons


def _moments(met: Floats) -> tuple[Floats, Floats]:
    """Means (N, 3) and covariances (N, 3, 3) of points (1 + 2 n, N, 3)."""
    mean, plus, minus = met[0], met[1::2], met[2::2]
    first = (plus - minus) / (2 * _STEP)
    bent = (plus + minus - 2 * mean) / (2 * _STEP**2)
    second = bent * np.sqrt(_STEP**2 - 1)
    covariances = np.einsum("kni,knj->nij", first, first)
    covariances += np.einsum("kni,knj->nij", second, second)
    return mean + bent.sum(axis=0), covariances
