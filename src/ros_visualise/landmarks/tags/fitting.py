"""Corners of tags to a hundredth of a pixel: the whole tag is drawn as it should look, and fitted.

When a tag has been read, all its cells are known. So every pixel near an edge between a black and a
white cell is explained at once: by where the corners are, by a blur, which may be longer in one
direction, by levels of gray that change over the tag, by a curve from light to levels (gamma), and
by how far white spills over black. What the sides alone cannot tell apart is told apart here: a
larger tag from one whose white has grown, and the next cells from the blur. How exact the corners
are follows from what is left unexplained, tag by tag.

Source: B. Lucas, T. Kanade, An Iterative Image Registration Technique, 1981; the covariance is that
of H. White, Maximum Likelihood Estimation of Misspecified Models, 1982, by groups of pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Pixels
from ros_visualise.landmarks.tags.appearance import Appearance, appearance

_OUTSIDE = 0.6  # of a cell around the square is looked at; beyond may be anything
_NEAR_PX = 2.5  # of an edge between cells
_MOST, _CANDIDATES = 900, 6000  # pixels of a tag that are fitted, and that are thought of
_LEAST = 60
_ROUNDS, _SETTLED_PX = 8, 5e-3
_STEP_PX, _MOST_PX = 1.0, 3.0  # of a corner in one round, and in all
_BLUR_PX2, _LEAST_BLUR, _MOST_BLUR = 0.4, 0.08, 6.0  # variances
_LEAST_CONTRAST = 5.0  # levels of gray
_WORST_FIT = 0.2  # of the contrast, that pixels are off
_UNSEEN = 1.1  # times what is left tells, squared errors are: some of what is wrong fits the tag
_RIDGE = 1e-7


class Fitted(NamedTuple):
    """Of T tags."""

    corners_uv: Floats
    """(T, 4, 2) pixels, as they were where nothing could be fitted."""
    covariance_px2: Floats
    """(T, 8, 8) of u and v of the first corner, of the second, and so on; NaN where not fitted."""


class _State(NamedTuple):
    """What is fitted to T tags: corners about their middles, blurs, and weights of `_levels`."""

    corners: Floats
    blur: Floats
    levels: Floats


class _Samples(NamedTuple):
    """N pixels of each of T tags; of those that have fewer, some have no weight."""

    places: Floats
    """(T, N, 2) about the middles of the tags."""
    gray: Floats
    weight: Floats


def fit_tags(gray: Pixels, corners_uv: Floats, cells: npt.ArrayLike, rim: int) -> Fitted:
    """Better corners of tags of one family.

    Args:
        gray: (height, width) uint8.
        corners_uv: (T, 4, 2) pixels, a pixel or so from the truth: lower left, lower right, upper
            right and upper left.
        cells: (T, C, C) of each tag, upright, 1 is white, with what is printed around its square.
        rim: how many of those are around the square.
    """
    patterns = np.asarray(cells, np.float64)[:, ::-1].swapaxes(1, 2)
    square = _square(patterns.shape[1], rim)
    middles = corners_uv.mean(axis=1, keepdims=True)
    samples = _sampled(gray, corners_uv - middles, middles[:, 0], patterns, square)
    begun = corners_uv - middles
    blur = np.tile([_BLUR_PX2, 0.0, _BLUR_PX2], (len(begun), 1))
    state = _State(begun, blur, np.zeros((len(begun), 10)))
    with np.errstate(all="ignore"):  # of what is no such tag
        for _ in range(_ROUNDS):
            residual, J, seen = _linearised(state, samples, patterns, square)
            step, inverse = _solved(J, residual)
            state = _moved(state, step)
            if np.abs(step[:, :8]).max(initial=0, where=np.isfinite(step[:, :8])) < _SETTLED_PX:
                break
        left = residual - (J @ step[..., None])[..., 0]
        spread = _covariance(left, J, inverse, samples.weight, seen)
        is_good = _is_good(state, step, left, samples.weight, begun) & _is_proper(spread)
    fitted = np.where(is_good[:, None, None], state.corners + middles, corners_uv)
    return Fitted(fitted, np.where(is_good[:, None, None], spread, np.nan))


def _square(cells: int, rim: int) -> Floats:
    """(4, 2) the corners of the square, in cells from the lower left of what is printed."""
    a, b = float(rim), float(cells - rim)
    return np.array([[a, a], [b, a], [b, b], [a, b]])


def _sampled(
    gray: Pixels, corners: Floats, middles: Floats, patterns: Floats, square: Floats
) -> _Samples:
    several = [
        _near_edges(gray, *one, square) for one in zip(corners, middles, patterns, strict=True)
    ]
    many = max([_LEAST, *map(len, several)])
    places, weight = np.zeros((len(several), many, 2)), np.zeros((len(several), many))
    for tag, one in enumerate(several):
        places[tag, : len(one)], weight[tag, : len(one)] = one - middles[tag], 1
    u, v = (places + middles[:, None]).round().astype(int).reshape(-1, 2).T
    levels = gray[np.clip(v, 0, gray.shape[0] - 1), np.clip(u, 0, gray.shape[1] - 1)]
    return _Samples(places, levels.reshape(weight.shape).astype(np.float64), weight)


def _near_edges(
    gray: Pixels, corners: Floats, middle: Floats, pattern: Floats, square: Floats
) -> Floats:
    """The pixels (N, 2) of a tag that are near edges between cells that differ, evenly thinned."""
    H = homographies(corners[None], square)[0]
    (low, _), (high, _) = square[0] - _OUTSIDE, square[2] + _OUTSIDE
    around = np.array([[low, low, 1], [high, low, 1], [high, high, 1], [low, high, 1]])
    outline = around @ np.linalg.inv(H).T
    outline = outline[:, :2] / outline[:, 2:] + middle
    first = np.maximum(np.ceil(outline.min(axis=0)), 0).astype(int)
    last = np.minimum(np.floor(outline.max(axis=0)), np.array(gray.shape[::-1]) - 1).astype(int)
    every = max(1, int(np.sqrt(max(np.prod(last - first + 1.0), 0) / _CANDIDATES)))
    u, v = np.meshgrid(*(np.arange(a, b + 1, every) for a, b in zip(first, last, strict=True)))
    places = np.stack([u.ravel(), v.ravel()], axis=1).astype(np.float64)
    projected = (places - middle) @ H[:, :2].T + H[:, 2]
    xy = projected[:, :2] / projected[:, 2:]
    cell_px = np.sqrt(_area(corners)) / (square[2, 0] - square[0, 0])
    apart = np.abs(xy - xy.round()).min(axis=1) * cell_px
    inside = ((xy > low) & (xy < high)).all(axis=1) & (apart < _NEAR_PX)
    x, y = np.clip(np.floor(xy[inside] - 0.5).astype(int), 0, len(pattern) - 2).T
    whites = pattern[x, y] + pattern[x + 1, y] + pattern[x, y + 1] + pattern[x + 1, y + 1]
    near = places[inside][(whites > 0) & (whites < 4)]
    thinned = np.linspace(0, len(near) - 1, min(len(near), _MOST)).astype(int)
    return np.asarray(near[thinned])


def _area(corners: Floats) -> float:
    (a, b), (c, d) = corners[2] - corners[0], corners[3] - corners[1]
    return float(abs(a * d - b * c) / 2)


def homographies(corners: Floats, square: Floats) -> Floats:
    """(T, 3, 3) from pixels about the middles of tags (T, 4, 2) to cells (4, 2)."""
    x, y = np.broadcast_to(square, corners.shape).transpose(2, 0, 1)
    u, v = corners.transpose(2, 0, 1)
    one, none = np.ones_like(u), np.zeros_like(u)
    rows = [
        np.stack([u, v, one, none, none, none, -u * x, -v * x], axis=2),
        np.stack([none, none, none, u, v, one, -u * y, -v * y], axis=2),
    ]
    equations = np.concatenate(rows, axis=1)
    equations = np.where(np.isfinite(equations), equations, 0) + 1e-12 * np.eye(8)
    solved = np.linalg.solve(equations, np.concatenate([x, y], axis=1)[..., None])[..., 0]
    whole = np.concatenate([solved, np.ones((len(solved), 1))], axis=1)
    return np.asarray(whole.reshape(-1, 3, 3))


def _linearised(
    state: _State, samples: _Samples, patterns: Floats, square: Floats
) -> tuple[Floats, Floats, Appearance]:
    """Residuals (T, N), their derivatives (T, N, 21) by corners, blur and levels, and the looks."""
    H = homographies(state.corners, square)
    seen = appearance(H, samples.places, state.blur, patterns)
    size = np.abs(state.corners).max(axis=(1, 2))[:, None, None]
    u, v = np.moveaxis(samples.places / size, 2, 0)
    columns = _levels(seen, u, v)
    weights = state.levels
    if not weights.any():  # the first round
        weights = np.zeros_like(weights)
        weights[:, :2] = _solved(columns[..., :2] * samples.weight[..., None], samples.gray)[0]
    first, second, third, by_u, by_v = np.moveaxis(weights[:, 1:6, None], 1, 0)
    m = seen.white
    gain = first + 2 * second * m + 3 * third * m * m + by_u * u + by_v * v
    by_warps = _warped(samples.places / size, seen.slope)
    by_corners = by_warps @ -np.linalg.inv(_warps(state.corners / size))
    moving = np.concatenate([by_corners, seen.by_blur], axis=2) * gain[..., None]
    J = np.concatenate([moving, columns], axis=2) * samples.weight[..., None]
    residual = samples.gray - (columns @ weights[..., None])[..., 0]
    state.levels[...] = weights
    return residual * samples.weight, J, seen


def _levels(seen: Appearance, u: Floats, v: Floats) -> Floats:
    """(T, N, 10) what levels of gray are a sum of."""
    m, one = seen.white, np.ones_like(u)
    grown = np.linalg.norm(seen.slope, axis=2)
    return np.stack([one, m, m**2, m**3, m * u, m * v, u, v, grown, seen.beyond], axis=2)


def _warps(corners: Floats) -> Floats:
    """(T, 8, 8) how u and v of corners (T, 4, 2) change when homographies change a little."""
    along_u, along_v = (np.broadcast_to(axis, corners.shape) for axis in np.eye(2))
    both = np.stack([_warped(corners, along_u), _warped(corners, along_v)], axis=2)
    return np.asarray(both.reshape(-1, 8, 8))


def _warped(places: Floats, slope: Floats) -> Floats:
    """(T, N, 8) how what has that slope (T, N, 2) changes at places that homographies move."""
    (u, v), (by_u, by_v) = np.moveaxis(places, 2, 0), np.moveaxis(slope, 2, 0)
    inward = u * by_u + v * by_v
    warped = [by_u, u * by_u, v * by_u, by_v, u * by_v, v * by_v, u * inward, v * inward]
    return np.stack(warped, axis=2)


def _solved(J: Floats, residual: Floats) -> tuple[Floats, Floats]:
    """Least squares (T, K), and the inverse (T, K, K) of their normal matrix."""
    transposed = np.swapaxes(J, 1, 2)
    normal = transposed @ J
    scale = np.sqrt(np.diagonal(normal, axis1=1, axis2=2)) + 1e-12
    normed = normal / scale[:, :, None] / scale[:, None, :]
    known = np.isfinite(normed).all(axis=(1, 2), keepdims=True)
    identity = np.eye(J.shape[2])
    inverted = np.asarray(
        np.linalg.inv(np.where(known, normed, identity) + _RIDGE * identity), np.float64
    )
    inverse = np.where(known, inverted / scale[:, :, None] / scale[:, None, :], np.nan)
    return (inverse @ (transposed @ residual[..., None]))[..., 0], inverse


def _moved(state: _State, step: Floats) -> _State:
    shift = np.clip(step[:, :8], -_STEP_PX, _STEP_PX).reshape(-1, 4, 2)
    blur = state.blur + np.clip(step[:, 8:11], -0.5, 0.5)
    uu, vv = (np.clip(blur[:, axis], _LEAST_BLUR, _MOST_BLUR) for axis in (0, 2))
    most = 0.9 * np.sqrt(uu * vv)
    uv = np.clip(blur[:, 1], -most, most)
    levels = state.levels + step[:, 11:]
    return _State(state.corners + shift, np.stack([uu, uv, vv], axis=1), levels)


def _covariance(
    left: Floats, J: Floats, inverse: Floats, weight: Floats, seen: Appearance
) -> Floats:
    """(T, 8, 8) of corners, by what is left unexplained."""
    count = weight.sum(axis=1)
    free = np.maximum(count - J.shape[2], 1)
    by_pixels = inverse[:, :8, :8] * ((left * left).sum(axis=1) / free)[:, None, None]
    x, y = np.floor(seen.xy).astype(int).transpose(2, 0, 1)
    cell = np.where(weight > 0, x * 32 + y, -1)
    pulls = inverse[:, :8] @ np.swapaxes(J * left[..., None], 1, 2)
    by_cells = np.empty_like(by_pixels)
    for tag, (pull, group) in enumerate(zip(pulls, cell, strict=True)):
        groups = np.unique(group[group >= 0])
        sums = pull @ (group[:, None] == groups).astype(np.float64)
        few = len(groups) / max(len(groups) - J.shape[2], 1)
        by_cells[tag] = few * sums @ sums.T
    return np.asarray(_UNSEEN * (by_pixels + by_cells) / 2)


def _is_good(
    state: _State, step: Floats, left: Floats, weight: Floats, begun: Floats
) -> npt.NDArray[np.bool_]:
    """Whether the fit has settled near where it began, on something that looks as it should."""
    count = weight.sum(axis=1)
    contrast = state.levels[:, 1:4].sum(axis=1)
    misfit = np.sqrt((left * left).sum(axis=1) / np.maximum(count, 1))
    moved = np.abs(state.corners - begun).max(axis=(1, 2))
    return np.asarray(
        (count >= _LEAST)
        & (contrast > _LEAST_CONTRAST)
        & (misfit < _WORST_FIT * contrast)
        & (moved < _MOST_PX)
        & (np.abs(step[:, :8]).max(axis=1) < 20 * _SETTLED_PX)
    )


def _is_proper(spread: Floats) -> npt.NDArray[np.bool_]:
    known = np.isfinite(spread).all(axis=(1, 2), keepdims=True)
    least = np.linalg.eigvalsh(np.where(known, spread, np.eye(8)))[:, 0]
    return np.asarray(known).reshape(-1) & np.asarray(least > 0)
