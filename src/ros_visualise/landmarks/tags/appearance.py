"""Rendering of a tag: its cells with a blur, and derivatives by its position.

A blurred cell is the product of two blurred stripes, except for sheared cells near their corners.
There the first omitted term is added, since a blur spreads like heat.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ros_visualise.data import Floats

_FAR = 7.0  # standard deviations; beyond, densities are subnormal numbers, which are slow


class TagAppearance(NamedTuple):
    """T tags at N points of the image each."""

    white: Floats
    """(T, N) fraction of white, 0 to 1."""
    slope: Floats
    """(T, 2, N) its derivatives by u and v, per pixel."""
    by_blur: Floats
    """(T, 3, N) its derivatives by the blur's variances: uu, uv, vv."""
    xy: Floats
    """(T, N, 2) the points in cells, from the lower left of the print."""
    beyond: Floats
    """(T, N) fraction of the surroundings of the print."""


def appearance(H: Floats, places_uv: Floats, blur_px2: Floats, patterns: Floats) -> TagAppearance:
    """Render tags.

    Args:
        H: (T, 3, 3) homographies from the image to cells.
        places_uv: (T, N, 2) pixels.
        blur_px2: (T, 3) the variances uu, uv and vv of a Gaussian blur, in square pixels.
        patterns: (T, C, C) by x, then by y upwards; 1 is white. The outermost cells extend to
            infinity.
    """
    u, v = _single(places_uv.transpose(2, 0, 1))
    h = _single(H.transpose(1, 2, 0)[..., None])
    depth = h[2, 0] * u + h[2, 1] * v + h[2, 2]
    x = (h[0, 0] * u + h[0, 1] * v + h[0, 2]) / depth
    y = (h[1, 0] * u + h[1, 1] * v + h[1, 2]) / depth
    x_u, x_v = (h[0, 0] - x * h[2, 0]) / depth, (h[0, 1] - x * h[2, 1]) / depth
    y_u, y_v = (h[1, 0] - y * h[2, 0]) / depth, (h[1, 1] - y * h[2, 1]) / depth
    uu, uv, vv = _single(blur_px2.T[..., None])
    xx = x_u * x_u * uu + 2 * x_u * x_v * uv + x_v * x_v * vv
    yy = y_u * y_u * uu + 2 * y_u * y_v * uv + y_v * y_v * vv
    xy = x_u * y_u * uu + (x_u * y_v + x_v * y_u) * uv + x_v * y_v * vv
    across, by_x, by_xx = _stripes(x, np.sqrt(xx), patterns.shape[1])
    up, by_y, by_yy = _stripes(y, np.sqrt(yy), patterns.shape[1])
    columns = _single(patterns.swapaxes(1, 2))
    rows, rows_x = columns @ across, columns @ by_x
    m_x, m_y, m_xy = _dot(rows_x, up), _dot(rows, by_y), _dot(rows_x, by_y)
    m_xx, m_yy = _dot(columns @ by_xx, up), _dot(rows, by_yy)
    m_uu = x_u * x_u * m_xx + 2 * x_u * y_u * m_xy + y_u * y_u * m_yy
    m_uv = x_u * x_v * m_xx + (x_u * y_v + x_v * y_u) * m_xy + y_u * y_v * m_yy
    m_vv = x_v * x_v * m_xx + 2 * x_v * y_v * m_xy + y_v * y_v * m_yy
    return TagAppearance(
        _dot(rows, up) + xy * m_xy,
        np.stack([x_u * m_x + y_u * m_y, x_v * m_x + y_v * m_y], axis=1),
        np.stack([m_uu / 2, m_uv, m_vv / 2], axis=1),
        np.stack([x, y], axis=2),
        1 - _within(x, np.sqrt(xx), patterns.shape[1]) * _within(y, np.sqrt(yy), patterns.shape[1]),
    )


def _single(values: Floats) -> Any:
    """Single precision: accurate to 1e-5 pixels, and twice as fast."""
    return values.astype(np.float32)


def _within(x: Floats, deviation: Floats, count: int) -> Floats:
    """Visible fraction of a stripe of width C at x."""
    return _normal(x / deviation)[0] - _normal((x - count) / deviation)[0]


def _stripes(x: Floats, deviation: Floats, count: int) -> tuple[Floats, Floats, Floats]:
    """Visible fraction of each of C stripes of width 1 at x (T, N), and two derivatives by x.

    All are (T, C, N).
    """
    edges, deviation = np.arange(1, count, dtype=x.dtype)[:, None], deviation[:, None]
    z = (x[:, None] - edges) / deviation
    beyond, density = _normal(z)
    density /= deviation
    curve = -z * density / deviation
    return _between(beyond, 1.0), _between(density, 0.0), _between(curve, 0.0)


def _between(edges: Floats, first: float) -> Floats:
    """Differences of neighbouring values at the edges (T, C - 1, N), starting from ``first``."""
    tags, count, pixels = edges.shape
    found = np.empty((tags, count + 1, pixels), edges.dtype)
    found[:, 0], found[:, -1] = first, 0
    found[:, 1:] = edges
    found[:, :-1] -= edges
    return found


def _dot(one: Floats, other: Floats) -> Floats:
    return np.asarray(np.einsum("tcn,tcn->tn", one, other))


def _normal(z: Floats) -> tuple[Floats, Floats]:
    """Distribution function and density of the normal distribution.

    Source: Page, Approximations to the cumulative normal function, 1977; within 0.0002.
    """
    z = np.clip(z, -_FAR, _FAR)
    square = z * z
    step = 0.5 + 0.5 * np.tanh(z * (0.7988 + 0.03528 * square))
    return step, np.exp(-0.5 * square) / math.sqrt(2 * math.pi)
