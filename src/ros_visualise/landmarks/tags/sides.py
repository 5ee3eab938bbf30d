"""Corners of squares to a hundredth of a pixel: where blurred steps fitted to their sides meet.

AprilTag weighs places by the gradient there, which the next cells pull at. Here all pixels near a
side are explained at once, by two levels of gray, a line between them and the width of the blur.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Pixels

_ALONG, _ACROSS = 32, 13  # samples of a side
_REACH = 0.5  # of a cell to either side: what is beyond it blurs in
_FARTHEST_PX, _NEAREST_PX = 3.0, 1.0  # that reach, too
_ROUNDS = 6
_BLUR_PX, _LEAST_BLUR, _MOST_BLUR = 0.8, 0.3, 3.0  # standard deviations
_LEAST_STEP = 5.0  # levels of gray
_MOST_PX = 2.0  # that the fit goes astray before it may come back


def fit_corners(gray: Pixels, corners_uv: Floats, cells: npt.ArrayLike) -> Floats:
    """Better corners; those of a square to whose sides no step fits stay as they are.

    Args:
        gray: (height, width) uint8.
        corners_uv: (T, 4, 2) pixels, in order around each square, about a pixel from the truth.
        cells: (T,) along a side of each; next to a side the outermost ones are of one colour.

    Returns:
        (T, 4, 2) pixels.
    """
    if not len(corners_uv):
        return corners_uv
    begin = corners_uv.reshape(-1, 2)
    along = np.roll(corners_uv, -1, axis=1).reshape(-1, 2) - begin
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
    normal /= np.linalg.norm(along, axis=1, keepdims=True)
    cell = _heights(corners_uv, normal) / np.repeat(cells, 4)
    reach = np.clip(_REACH * cell, 0, _FARTHEST_PX)
    ends = 0.5 / np.repeat(cells, 4)  # the blur of the corners is left out
    x, s = np.linspace(-1, 1, _ALONG), np.linspace(-1, 1, _ACROSS) * reach[:, None]
    share = 0.5 + np.multiply.outer(0.5 - ends, x)
    on_side = begin[:, None] + share[..., None] * along[:, None]
    places = on_side[:, :, None] + s[:, None, :, None] * normal[:, None, None]
    shift, slope, is_good = _fit_steps(_sample(gray, places), x, s)
    first = on_side[:, 0] + (shift - slope)[:, None] * normal
    last = on_side[:, -1] + (shift + slope)[:, None] * normal
    fitted = _meeting(first.reshape(-1, 4, 2), last.reshape(-1, 4, 2))
    is_near = np.abs(shift) + np.abs(slope) < reach
    taken = (is_good & is_near & (reach > _NEAREST_PX)).reshape(-1, 4).all(axis=1)
    return np.asarray(np.where(taken[:, None, None], fitted, corners_uv))


def _heights(corners: Floats, normal: Floats) -> Floats:
    """Across each side (4T,), how far the nearer one of the two other corners is from it."""
    begin = corners.reshape(-1, 2)
    others = [np.roll(corners, -n, axis=1).reshape(-1, 2) - begin for n in (2, 3)]
    return np.asarray(np.min([np.abs((one * normal).sum(axis=1)) for one in others], axis=0))


def _sample(gray: Pixels, places: Floats) -> Floats:
    flat = places.reshape(len(places), -1, 2).astype(np.float32)
    u, v = cv2.split(flat)
    levels = cv2.remap(gray, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    found: Floats = levels.reshape(places.shape[:3]).astype(np.float64)
    return found


def _fit_steps(
    levels: Floats, x: Floats, s: Floats
) -> tuple[Floats, Floats, npt.NDArray[np.bool_]]:
    """Fit ``a + c x + b Phi((s - shift - slope x) / blur)`` to each side, by Gauss-Newton.

    Args:
        levels: (S, N, M) gray at N places along and M across each side.
        x: (N,) -1 to 1 along it.
        s: (S, M) pixels across it.

    Returns:
        Shift and slope (S,), pixels, and whether there is a step.
    """
    before, after = levels[..., :3].mean(axis=(1, 2)), levels[..., -3:].mean(axis=(1, 2))
    zero = np.zeros_like(before)
    params = np.stack([before, zero, after - before, zero, zero, zero + _BLUR_PX], axis=1)
    x_of, s_of = x[None, :, None], s[:, None, :]
    for _ in range(_ROUNDS):
        a, c, b, shift, slope, blur = params.T[:, :, None, None]
        z = (s_of - shift - slope * x_of) / blur
        step, density = _normal(z)
        pull = -b * density / blur
        parts = (np.ones_like(z), x_of + 0 * z, step, pull, pull * x_of, pull * z)
        J = np.stack(parts, axis=-1).reshape(len(levels), -1, len(parts))
        residuals = (levels - a - c * x_of - b * step).reshape(len(levels), -1, 1)
        normal = J.swapaxes(1, 2) @ J + 1e-3 * np.eye(len(parts))
        params = params + np.linalg.solve(normal, J.swapaxes(1, 2) @ residuals)[..., 0]
        params[:, 3:5] = np.clip(params[:, 3:5], -_MOST_PX, _MOST_PX)
        params[:, 5] = np.clip(params[:, 5], _LEAST_BLUR, _MOST_BLUR)
    return params[:, 3], params[:, 4], np.abs(params[:, 2]) > _LEAST_STEP


def _normal(z: Floats) -> tuple[Floats, Floats]:
    """Distribution function and density of the normal distribution.

    Source: Page, Approximations to the cumulative normal function, 1977; within 0.0002.
    """
    step = 1 / (1 + np.exp(np.clip(-z * (1.5976 + 0.07056 * z * z), -50, 50)))
    return step, np.exp(-z * z / 2) / np.sqrt(2 * np.pi)


def _meeting(first: Floats, last: Floats) -> Floats:
    """Where each of the lines through (T, 4, 2) and (T, 4, 2) meets the one before it."""
    one = np.ones((*first.shape[:2], 1))
    lines = np.cross(np.concatenate([first, one], axis=2), np.concatenate([last, one], axis=2))
    points = np.cross(np.roll(lines, 1, axis=1), lines)
    with np.errstate(divide="ignore", invalid="ignore"):  # of sides that are not fitted
        corners: Floats = points[..., :2] / points[..., 2:]
    return corners
