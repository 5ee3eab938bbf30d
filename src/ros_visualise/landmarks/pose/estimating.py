"""Poses of bodies from their points in an image, with covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ros_visualise.data import CameraInfo, Floats
from ros_visualise.geometry import rotations
from ros_visualise.landmarks.pose.corner_errors import CornerErrors
from ros_visualise.landmarks.pose.corner_noise import (
    EXACT,
    CameraError,
    corner_noise,
    whitening,
)
from ros_visualise.landmarks.pose.covariance import covariances, difference
from ros_visualise.landmarks.pose.rays import Rays, rays_of
from ros_visualise.landmarks.pose.refinement import RefinedPoses, linearise, refine
from ros_visualise.landmarks.pose.starting import starts

SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) / 2
_EXCLUDED = 9.0  # log of the likelihood ratio, 1 to 8000, at which a solution is rejected
_FAR_PX = 1e6  # larger than any image
_SMALLEST_PX2 = 1.0  # least double area of three corners of a square
_NO_FIT = 0.15  # largest error, as a fraction of the extent of the corners
_SAME = 1e-3  # radians between identical solutions


@dataclass(frozen=True, eq=False)
class PoseEstimate:
    """A possible pose of a body, in the camera's optical frame (z forward, x right, y down).

    ``position_xyz`` (3,) in metres and ``quat_xyzw`` (4,) transform points of the body's frame to
    the camera's. ``covariance`` (6, 6) is ordered as that of geometry_msgs/PoseWithCovariance: x,
    y, z, then rotations about the x, y and z axis of the camera's frame, in radians; it is valid if
    this solution is the right one. ``probability`` is that of this solution among those of the same
    image. ``rms_px`` is the root mean square reprojection error of the points.
    """

    position_xyz: Floats
    quat_xyzw: Floats
    covariance: Floats
    rms_px: float
    probability: float = 1.0


def square_poses(
    corners_uv: npt.ArrayLike,
    size_m: float,
    info: CameraInfo,
    sigma_px: float | None = None,
    camera: CameraError = EXACT,
    noise_px2: npt.ArrayLike | None = None,
    errors: CornerErrors | None = None,
) -> tuple[PoseEstimate, ...]:
    """Possible poses of a square tag, best first: two, one or none.

    The image of a square has two readings. Both are given, unless the corners exclude one.

    Args:
        corners_uv: (4, 2) pixels of the unrectified image, origin at the centre of the top-left
            pixel: the tag's lower left, lower right, upper right and upper left corner.
        size_m: side of the square. The tag's frame is x right, y up, z towards the viewer.
        info: the camera's calibration.
        sigma_px: standard deviation of each coordinate of a corner; default: from `corner_noise`
            and `CornerErrors`.
        camera: errors of the camera; its floor counts only without ``sigma_px``.
        noise_px2: (8, 8) covariance of the corners from the detector, `Tag.covariance_px2`.
        errors: of this camera, from its earlier images; they learn from this one.

    Raises:
        UncalibratedCamera: no calibration.
        ValueError: the corners are not (4, 2), or the size is not positive.
    """
    corners = np.asarray(corners_uv, np.float64)
    if corners.shape != (4, 2):
        raise ValueError(f"the corners of a square must have shape (4, 2), not {corners.shape}")
    sigmas = None if sigma_px is None else [sigma_px]
    noise = None if noise_px2 is None else np.asarray(noise_px2)[None]
    return squares_poses(corners[None], [size_m], info, sigmas, camera, noise, errors)[0]


def squares_poses(
    corners_uv: npt.ArrayLike,
    sizes_m: npt.ArrayLike,
    info: CameraInfo,
    sigmas_px: npt.ArrayLike | None = None,
    camera: CameraError = EXACT,
    noise_px2: npt.ArrayLike | None = None,
    errors: CornerErrors | None = None,
) -> list[tuple[PoseEstimate, ...]]:
    """`square_poses` for T tags in one image: corners (T, 4, 2), sizes and sigmas (T,).

    For fifty tags this takes a tenth of the time of fifty calls.
    """
    corners = np.asarray(corners_uv, np.float64).reshape(-1, 4, 2)
    sizes = np.asarray(sizes_m, np.float64)
    if not (sizes > 0).all():
        raise ValueError("a tag's size must be positive")
    seen = np.where(_is_seen(corners)[:, None, None], corners, np.nan)
    points = SQUARE * sizes[:, None, None]
    if sigmas_px is None:
        noise = corner_noise(seen, known_px2=noise_px2)
        return _estimate(points, seen, info, noise, camera, errors or CornerErrors(camera.floor_px))
    variances = np.asarray(sigmas_px, np.float64)[:, None, None] ** 2
    return _estimate(points, seen, info, variances * np.eye(8), camera)


def rig_poses(
    corners_uv: npt.ArrayLike,
    points_xyz: npt.ArrayLike,
    info: CameraInfo,
    sigma_px: npt.ArrayLike | None = None,
    camera: CameraError = EXACT,
    noise_px2: npt.ArrayLike | None = None,
    errors: CornerErrors | None = None,
) -> tuple[PoseEstimate, ...]:
    """Possible poses of a rigid body with several tags, as `square_poses`.

    Args:
        corners_uv: (N, 2) pixels, N >= 4.
        points_xyz: (N, 3) metres in the body's frame.
        info: the camera's calibration.
        sigma_px: for all points or (N,); default as for a square, the points being the corners of
            tags, four each.
        camera, noise_px2, errors: as for squares, for each tag.

    Raises:
        UncalibratedCamera: no calibration.
        ValueError: inconsistent shapes.
    """
    corners, points = np.asarray(corners_uv, np.float64), np.asarray(points_xyz, np.float64)
    if corners.shape != (len(points), 2) or points.shape != (len(points), 3) or len(points) < 4:
        raise ValueError(
            "a body needs corners (N, 2) and points (N, 3), N at least 4; their shapes are"
            f" {corners.shape} and {points.shape}"
        )
    if sigma_px is None:
        noise = _of_body(corner_noise(corners.reshape(-1, 4, 2), known_px2=noise_px2))
        errors = errors or CornerErrors(camera.floor_px)
    else:
        deviations = np.broadcast_to(np.asarray(sigma_px, np.float64), len(points))
        noise, errors = np.diag(np.repeat(deviations**2, 2)), None
    return _estimate(points[None], corners[None], info, noise[None], camera, errors)[0]


def merged(estimates: Sequence[PoseEstimate]) -> PoseEstimate:
    """The best estimate with a covariance that includes the others.

    It is the second moment about the best, each weighted by its probability, so it is valid
    whichever of them is right.

    Args:
        estimates: one or more, best first, from `square_poses`.
    """
    best = estimates[0]
    R, t = rotations.to_matrix(best.quat_xyzw), best.position_xyz
    total = np.zeros((6, 6))
    for one in estimates:
        away = difference(R, t, rotations.to_matrix(one.quat_xyzw), one.position_xyz)
        total += one.probability * (one.covariance + np.outer(away, away))
    return replace(best, covariance=total / sum(one.probability for one in estimates))


def _is_seen(corners: Floats) -> npt.NDArray[np.bool_]:
    """Mask of corners (T, 4, 2) that may be squares seen from the front: convex, anticlockwise."""
    finite = np.abs(corners) < _FAR_PX  # false for NaN
    sides = np.roll(np.where(finite, corners, 0.0), -1, axis=1) - np.where(finite, corners, 0.0)
    after = np.roll(sides, -1, axis=1)
    areas = sides[..., 1] * after[..., 0] - sides[..., 0] * after[..., 1]
    return np.asarray(finite.all(axis=(1, 2)) & (areas > _SMALLEST_PX2).all(axis=1))


def _of_body(noise_px2: Floats) -> Floats:
    """(8T, 8T) covariance of all corners of a body, from those of its tags (T, 8, 8)."""
    blocks = np.einsum("ab,bij->aibj", np.eye(len(noise_px2)), noise_px2)
    return np.asarray(blocks.reshape(8 * len(noise_px2), -1))


def _estimate(
    points: Floats,
    corners: Floats,
    info: CameraInfo,
    noise: Floats,
    camera: CameraError,
    errors: CornerErrors | None = None,
) -> list[tuple[PoseEstimate, ...]]:
    """Poses of each body (B, N, ...), all with N points; without errors, the noise is all."""
    rays = rays_of(corners, info)
    begun = starts(points, rays.directions)
    found: list[tuple[PoseEstimate, ...]] = [()] * len(points)
    if not begun:
        return found
    R, t = (np.concatenate(parts) for parts in zip(*begun.values(), strict=True))
    bodies = list(begun)
    twice = np.repeat(bodies, 2)
    seen = points[twice], Rays(rays[0][twice], rays[1][twice])
    whiten = whitening(noise[twice])
    fit = refine(R, t, *seen, whiten)
    plain = np.broadcast_to(np.eye(whiten.shape[1]), whiten.shape)
    if errors or not camera.is_calibrated_exactly:
        raised = noise[bodies]
        if errors:
            best = 2 * np.arange(len(bodies)) + fit.chi2.reshape(-1, 2).argmin(axis=1)
            off, J = (part[best] for part in linearise(fit.R, fit.t, *seen, plain))
            errors.learn(corners[bodies], off, J, raised)
            raised = raised + errors.variance_px2 * plain[0]
        raised = raised + camera.of_calibration(corners[bodies], info)
        whiten = np.repeat(whitening(raised), 2, axis=0)
        fit = refine(fit.R, fit.t, *seen, whiten)
    spreads = covariances(fit, *seen, whiten)
    off, _ = linearise(fit.R, fit.t, *seen, plain)
    rms = np.sqrt((off * off).sum(axis=1) / points.shape[1])
    for number, body in enumerate(bodies):
        both = slice(2 * number, 2 * number + 2)
        two = RefinedPoses(*(part[both] for part in fit))
        spread_px = np.sqrt(corners[body].var(axis=0).sum())
        several = _solutions(two, spreads[both], rms[both])
        found[body] = tuple(one for one in several if one.rms_px < _NO_FIT * spread_px)
    return found


def _solutions(fit: RefinedPoses, spreads: Floats, rms_px: Floats) -> tuple[PoseEstimate, ...]:
    chi2 = np.where(np.isfinite(spreads).all(axis=(1, 2)), fit.chi2, np.inf)
    better, worse = np.argsort(chi2)
    if not np.isfinite(chi2[better]):
        return ()
    kept = [better]
    apart = difference(fit.R[0], fit.t[0], fit.R[1], fit.t[1])
    if np.linalg.norm(apart[3:]) > _SAME and (chi2[worse] - chi2[better]) / 2 < _EXCLUDED:
        kept.append(worse)
    # Laplace's approximation of the likelihood mass around each
    weights = np.exp((chi2[better] - chi2[kept]) / 2) * np.sqrt(np.linalg.det(spreads[kept]))
    return tuple(
        PoseEstimate(
            fit.t[one],
            rotations.from_matrix(fit.R[one]),
            spreads[one],
            float(rms_px[one]),
            float(weight / weights.sum()),
        )
        for one, weight in zip(kept, weights, strict=True)
    )
