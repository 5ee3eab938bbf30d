"""Corners of tags accurate to a hundredth of a pixel, by fitting a rendering of the whole tag.

Once a tag is decoded, all its cells are known. So all pixels near edges between black and white
cells are explained together: by the corners; a blur, possibly longer in one direction; levels of
gray that vary over the tag; a curve from light to levels (gamma), which lets white bleed over
black; and halos, as of sharpening. This separates what the outer sides alone cannot: a larger tag
from bleeding white, and neighbouring cells from blur. Through a calibrated lens this is done in the
tag's `TagView`, where its sides are straight. The accuracy of the corners follows from the
residuals, for each tag. Where they show that its cells are not on a flat grid (bent paper, a coarse
print), the corners found by its sides stay.

Source: B. Lucas, T. Kanade, An Iterative Image Registration Technique, 1981; the covariance is that
of H. White, Maximum Likelihood Estimation of Misspecified Models, 1982, by groups of pixels, these
being as few as in H. Hotelling, The Generalization of Student's Ratio, 1931.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from ros_visualise.data import CameraInfo, Floats, Pixels
from ros_visualise.landmarks.pose.corner_noise import corner_sigma
from ros_visualise.landmarks.tags.appearance import TagAppearance, appearance
from ros_visualise.landmarks.tags.samples import LEAST, TagSamples, homographies, sample_tags
from ros_visualise.landmarks.tags.views import block_diagonal, to_pixels, views_of

_ROUNDS = 8
_SETTLED_PX, _SETTLED = 5e-3, 0.5  # steps at convergence: pixels, or standard deviations
_RESTLESS_PX = 0.1  # last step of a fit that did not converge
_STEP_PX = 1.0  # largest shift of a corner in one round
_MOST_PX, _MOST_SHARE = 3.0, 0.05  # in total, or as a fraction of the tag's extent
_BLUR_PX2, _LEAST_BLUR, _MOST_BLUR = 0.4, 0.08, 6.0  # variances
_HALO_PX2 = np.array([1.5, 0.0, 1.5])  # additional blur of what sharpening subtracts
_LEAST_CONTRAST = 5.0  # levels of gray
_WORST_FIT = 0.2  # largest residual, as a fraction of the contrast
_UNSURE = 12.0  # deviation, relative to AprilTag's, of tags whose cells are not on a flat grid
_HOTELLING = 9  # degrees of freedom that are lost since a covariance of 8 numbers is estimated too
_MODEL_PX = 0.004  # error of the rendering itself, whose blur is a Gaussian's
_RIDGE = 1e-7


class Fitted(NamedTuple):
    """The fitted corners of T tags."""

    corners_uv: Floats
    """(T, 4, 2) pixels, unchanged if the fit failed, or if the cells do not fit the square."""
    covariance_px2: Floats
    """(T, 8, 8) of u and v of the first corner, of the second, and so on; NaN if not fitted."""


class _FitState(NamedTuple):
    """The fitted parameters of T tags: corners in their views, and blurs."""

    corners: Floats
    blur: Floats


class _Linear(NamedTuple):
    """The linearized rendering of T tags with N pixels."""

    residual: Floats
    """(T, N) levels of gray, with the best weights of `_levels`."""
    J: Floats
    """(T, 22, N) derivatives of gray by corners, blur and the weights of `_levels`."""
    contrast: Floats
    """(T,) levels of gray from black to white."""
    cell: Floats
    """(T, N) the cell of each pixel, -1 without weight."""


_Of = TypeVar("_Of", _FitState, TagSamples, _Linear)


def fit_tags(
    gray: Pixels,
    corners_uv: Floats,
    cells: npt.ArrayLike,
    rim: int,
    info: CameraInfo | None = None,
) -> Fitted:
    """Refine the corners of tags of one family.

    Args:
        gray: (height, width) uint8.
        corners_uv: (T, 4, 2) pixels, accurate to about a pixel: lower left, lower right, upper
            right and upper left.
        cells: (T, C, C) of each tag, upright, 1 is white, including the print around its square.
        rim: number of cells around the square.
        info: the camera's calibration, for the distortion of its lens; None: no distortion.
    """
    patterns = np.asarray(cells, np.float64)[:, ::-1].swapaxes(1, 2)
    square = _square(patterns.shape[1], rim)
    views = views_of(corners_uv, info)
    begun = np.array([view.of_pixels(uv) for view, uv in zip(views, corners_uv, strict=True)])
    begun = begun.reshape(-1, 4, 2)
    samples = sample_tags(gray, begun, views, patterns, square)
    fitted, covariance = begun.copy(), np.full((len(begun), 8, 8), np.nan)
    with np.errstate(all="ignore"):  # for false detections
        for tags, corners, spread in _fits(begun, samples, patterns, square):
            most = np.maximum(_MOST_PX, _MOST_SHARE * np.ptp(begun[tags], axis=1).max(axis=1))
            is_near = np.abs(corners - begun[tags]).max(axis=(1, 2)) < most
            good = is_near & _is_proper(spread)
            fitted[tags[good]] = corners[good]
            covariance[tags[good]] = spread[good]
    pixels, slopes = to_pixels(views, fitted, info)
    by_places = block_diagonal(slopes)
    covariance = by_places @ covariance @ np.swapaxes(by_places, 1, 2)
    good = np.isfinite(covariance).all(axis=(1, 2)) & np.isfinite(pixels).all(axis=(1, 2))
    covariance[~good] = np.nan
    least_sure = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).max(axis=1, initial=0))
    good &= least_sure < _UNSURE * corner_sigma(corners_uv)
    return Fitted(np.where(good[:, None, None], pixels, corners_uv), covariance)


def _fits(
    begun: Floats, samples: TagSamples, patterns: Floats, square: Floats
) -> Iterator[tuple[npt.NDArray[np.intp], Floats, Floats]]:
    """Indices of tags that have converged, their corners, and the covariances of these.

    A covariance is NaN if the image does not look like a tag.
    """
    tags = np.arange(len(begun))
    state = _FitState(begun, np.tile([_BLUR_PX2, 0.0, _BLUR_PX2], (len(begun), 1)))
    for number in range(_ROUNDS):
        linear = _linearised(state, samples, patterns, square)
        step, inverse = _solved(linear.J, linear.residual)
        state = _moved(state, step)
        left = linear.residual - _sum(linear.J, step)
        most = np.abs(step[:, :8]).max(axis=1, initial=0)
        settled = np.maximum(_SETTLED_PX, _SETTLED * _deviation(left, inverse, samples.weight))
        ends = most < (settled if number < _ROUNDS - 1 else _RESTLESS_PX)
        if ends.any():
            last, weight, left = _some(linear, ends), samples.weight[ends], left[ends]
            spread = _covariance(left, last, inverse[ends], weight)
            spread[~_is_good(left, last.contrast, weight)] = np.nan
            yield tags[ends], state.corners[ends], spread
        if ends.all():
            return
        tags, patterns = tags[~ends], patterns[~ends]
        state, samples = _some(state, ~ends), _some(samples, ~ends)


def _some(whole: _Of, chosen: npt.NDArray[np.bool_]) -> _Of:
    """The same for some of the tags."""
    return type(whole)(*(each[chosen] for each in whole))


def _square(cells: int, rim: int) -> Floats:
    """(4, 2) the corners of the square, in cells from the lower left of the print."""
    a, b = float(rim), float(cells - rim)
    return np.array([[a, a], [b, a], [b, b], [a, b]])


def _linearised(state: _FitState, samples: TagSamples, patterns: Floats, square: Floats) -> _Linear:
    """The rendering in a state, with the best levels of gray.

    Source of eliminating the levels: G. Golub, V. Pereyra, The Differentiation of Pseudo-Inverses
    and Nonlinear Least Squares Problems Whose Variables Separate, 1973.
    """
    H = homographies(state.corners, square)
    seen = appearance(H, samples.places, state.blur, patterns)
    halo = appearance(H, samples.places, state.blur + _HALO_PX2, patterns)
    size = np.abs(state.corners).max(axis=(1, 2))[:, None, None]
    places = samples.places / size
    u, v = places.transpose(2, 0, 1)
    levels = _levels(seen, halo, u, v) * samples.weight[:, None]
    gray = samples.gray * samples.weight
    weights = _solved(levels, gray)[0]
    first, second, third, by_u, by_v = weights[:, 1:6, None].transpose(1, 0, 2)
    m = seen.white
    gain = (first + 2 * second * m + 3 * third * m * m + by_u * u + by_v * v) * samples.weight
    wide = weights[:, -1:] * samples.weight
    by_warps = _warped(places, _mixed(seen.slope, gain, halo.slope, wide))
    by_corners = -np.linalg.inv(_warps(state.corners / size)) @ by_warps
    by_blur = _mixed(seen.by_blur, gain, halo.by_blur, wide)
    J = np.concatenate([by_corners, by_blur, levels], axis=1)
    x, y = np.floor(seen.xy).transpose(2, 0, 1)
    cell = np.where(samples.weight > 0, x * 32 + y, -1)
    return _Linear(
        gray - _sum(levels, weights), J, weights[:, 1:4].sum(axis=1) + weights[:, -1], cell
    )


def _mixed(one: Floats, gain: Floats, other: Floats, other_gain: Floats) -> Floats:
    return one * gain[:, None] + other * other_gain[:, None]


def _levels(seen: TagAppearance, halo: TagAppearance, u: Floats, v: Floats) -> Floats:
    """(T, 11, N) basis of the levels of gray."""
    m, one = seen.white, np.ones_like(u)
    levels = [one, m, m * m, m * m * m, m * u, m * v, u, v, seen.beyond, halo.beyond, halo.white]
    return np.stack(levels, axis=1)


def _warps(corners: Floats) -> Floats:
    """(T, 8, 8) derivatives of homographies, by row, by u and v of corners (T, 4, 2), by column."""
    along = np.broadcast_to(np.eye(2)[:, None, :, None], (2, len(corners), 2, 4))
    both = np.stack([_warped(corners, axis) for axis in along], axis=3)
    return np.asarray(both.reshape(-1, 8, 8))


def _warped(places: Floats, slope: Floats) -> Floats:
    """(T, 8, N) derivatives by homographies of a quantity with slope (T, 2, N) at given points."""
    (u, v), (by_u, by_v) = places.transpose(2, 0, 1), slope.transpose(1, 0, 2)
    inward = u * by_u + v * by_v
    warped = [by_u, u * by_u, v * by_u, by_v, u * by_v, v * by_v, u * inward, v * inward]
    return np.stack(warped, axis=1)


def _sum(columns: Floats, weights: Floats) -> Floats:
    """(T, N) weighted sums of columns (T, K, N)."""
    return np.asarray((weights[:, None] @ columns)[:, 0])


def _solved(J: Floats, residual: Floats) -> tuple[Floats, Floats]:
    """Least squares (T, K), and the inverse (T, K, K) of the normal matrix; J is (T, K, N)."""
    normal = J @ np.swapaxes(J, 1, 2)
    scale = np.sqrt(np.diagonal(normal, axis1=1, axis2=2)) + 1e-12
    normed = normal / scale[:, :, None] / scale[:, None, :]
    known = np.isfinite(normed).all(axis=(1, 2), keepdims=True)
    identity = np.eye(J.shape[1])
    inverted = np.asarray(
        np.linalg.inv(np.where(known, normed, identity) + _RIDGE * identity), np.float64
    )
    inverse = np.where(known, inverted / scale[:, :, None] / scale[:, None, :], np.nan)
    return (inverse @ (J @ residual[..., None]))[..., 0], inverse


def _moved(state: _FitState, step: Floats) -> _FitState:
    shift = np.clip(step[:, :8], -_STEP_PX, _STEP_PX).reshape(-1, 4, 2)
    blur = state.blur + np.clip(step[:, 8:11], -0.5, 0.5)
    least = np.maximum(state.blur / 2, _LEAST_BLUR)  # a blur that drops too fast recovers slowly
    uu, vv = (np.clip(blur[:, axis], least[:, axis], _MOST_BLUR) for axis in (0, 2))
    most = 0.9 * np.sqrt(uu * vv)
    uv = np.clip(blur[:, 1], -most, most)
    return _FitState(state.corners + shift, np.stack([uu, uv, vv], axis=1))


def _deviation(left: Floats, inverse: Floats, weight: Floats) -> Floats:
    """(T,) standard deviations of the least certain corners, pixels, from the residuals."""
    variance = (left * left).sum(axis=1) / np.maximum(weight.sum(axis=1), 1)
    least_sure = np.diagonal(inverse[:, :8, :8], axis1=1, axis2=2).max(axis=1, initial=0)
    return np.asarray(np.sqrt(variance * least_sure))


def _covariance(left: Floats, linear: _Linear, inverse: Floats, weight: Floats) -> Floats:
    """(T, 8, 8) of corners, from the residuals."""
    J = linear.J
    count = weight.sum(axis=1)
    free = np.maximum(count - J.shape[1], 1)
    by_pixels = inverse[:, :8, :8] * ((left * left).sum(axis=1) / free)[:, None, None]
    pulls = inverse[:, :8] @ (J * left[:, None])
    by_cells = np.empty_like(by_pixels)
    for tag, (pull, group) in enumerate(zip(pulls, linear.cell, strict=True)):
        order = np.argsort(group, kind="stable")[int(np.sum(group < 0)) :]
        starts = np.flatnonzero(np.diff(group[order], prepend=-1))
        sums = np.add.reduceat(pull[:, order], starts, axis=1)
        few = len(starts) / max(len(starts) - J.shape[1] - _HOTELLING, 1)
        by_cells[tag] = few * sums @ sums.T
    return np.asarray((by_pixels + by_cells) / 2 + _MODEL_PX**2 * np.eye(8))


def _is_good(left: Floats, contrast: Floats, weight: Floats) -> npt.NDArray[np.bool_]:
    """Mask of tags that look as they should."""
    count = weight.sum(axis=1)
    misfit = np.sqrt((left * left).sum(axis=1) / np.maximum(count, 1))
    return np.asarray(
        (count >= LEAST) & (contrast > _LEAST_CONTRAST) & (misfit < _WORST_FIT * contrast)
    )


def _is_proper(spread: Floats) -> npt.NDArray[np.bool_]:
    known = np.isfinite(spread).all(axis=(1, 2), keepdims=True)
    least = np.linalg.eigvalsh(np.where(known, spread, np.eye(8)))[:, 0]
    return np.asarray(known).reshape(-1) & np.asarray(least > 0)
