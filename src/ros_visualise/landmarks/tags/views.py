"""The surroundings of a tag, as a pinhole camera facing it would see them.

Only a pinhole camera sees the edges of a tag straight. So each tag is fitted in the image that such
a camera would take from the same place, looking along the ray of the tag's middle, where its pixels
are as large as the real ones. A polynomial through a grid of rays of the lens maps pixels there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ros_visualise.core.errors import UncalibratedCamera, UnsupportedImage
from ros_visualise.data import CameraInfo, Floats
from ros_visualise.landmarks.pose.rays import Rays, rays_of
from ros_visualise.vision.projection import project

_ORDER = 8
_NODES = np.cos(np.pi * (np.arange(_ORDER) + 0.5) / _ORDER)  # Chebyshev's, from -1 to 1
_POWERS = np.arange(_ORDER)
_TO_POWERS = np.linalg.inv(_NODES[:, None] ** _POWERS)
_MARGIN = 0.2  # around a tag, as a fraction of its extent


class TagView(NamedTuple):
    """The image around one tag; places are relative to ``middle_uv``, in its pixels."""

    middle_uv: Floats
    """(2,) pixel of the tag's middle."""
    axis: Rays | None = None
    """Its ray; None if the camera is a pinhole camera, or nothing is known of its lens."""
    reach: Floats = np.ones(2)
    """(2,) half of the extent in which ``weights`` hold, pixels."""
    weights: Floats = np.zeros((2, _ORDER, _ORDER))
    """Coefficients of powers of v, then of u, for both coordinates of a place."""

    def of_grid(self, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Both coordinates (M, N) of the places of pixels with columns (N,) and rows (M,)."""
        u, v = u - self.middle_uv[0], v - self.middle_uv[1]
        if self.axis is None:
            shape = (len(v), len(u))
            return np.broadcast_to(u, shape), np.broadcast_to(v[:, None], shape)
        by_u, by_v = (
            (u[:, None] / self.reach[0]) ** _POWERS,
            (v[:, None] / self.reach[1]) ** _POWERS,
        )
        x, y = by_v @ self.weights @ by_u.T
        return x, y

    def of_pixels(self, pixels_uv: Floats) -> Floats:
        """Places (N, 2) of pixels (N, 2)."""
        off = pixels_uv - self.middle_uv
        if self.axis is None:
            return np.asarray(off)
        by_u, by_v = ((off / self.reach).T)[..., None] ** _POWERS
        return np.asarray(np.einsum("ni,kij,nj->nk", by_v, self.weights, by_u))


def views_of(corners_uv: Floats, info: CameraInfo | None) -> list[TagView]:
    """The views of T tags (T, 4, 2).

    Without a lens that is known, the image itself is the view.
    """
    middles = corners_uv.mean(axis=1)
    if info is None or not (info.D.any() or info.distortion_model == "equidistant"):
        return [TagView(one) for one in middles]
    reach = (0.5 + _MARGIN) * np.ptp(corners_uv, axis=1)
    v, u = np.meshgrid(_NODES, _NODES, indexing="ij")
    nodes = middles[:, None, None] + np.stack([u, v], axis=-1) * reach[:, None, None]
    try:
        axes, rays = rays_of(middles, info), rays_of(nodes, info).directions
    except (UncalibratedCamera, UnsupportedImage):
        return [TagView(one) for one in middles]
    there = _on_plane(axes, rays)
    weights = _TO_POWERS @ there.transpose(0, 3, 1, 2) @ _TO_POWERS.T
    found = zip(middles, *axes, reach, weights, strict=True)
    return [
        TagView(uv, Rays(d, to_pixels), *rest) if np.isfinite(rest[1]).all() else TagView(uv)
        for uv, d, to_pixels, *rest in found
    ]


def _on_plane(axes: Rays, rays: Floats) -> Floats:
    """Places (T, N, M, 2) in the views along T axes of rays (T, N, M, 3)."""
    ahead = np.einsum("tk,tnmk->tnm", axes.directions, rays)
    there: Floats = np.einsum("tik,tnmk->tnmi", axes.to_pixels, rays) / ahead[..., None]
    return there


def to_pixels(
    views: list[TagView], places: Floats, info: CameraInfo | None
) -> tuple[Floats, Floats]:
    """Pixels (T, N, 2) of places in T views, and their derivatives (T, N, 2, 2) by these.

    NaN where the camera does not see them.
    """
    middles = np.array([one.middle_uv for one in views]).reshape(-1, 2)
    pixels = places + middles[:, None]
    slopes = np.broadcast_to(np.eye(2), (*places.shape, 2)).copy()
    bent = np.flatnonzero([one.axis is not None for one in views])
    if not len(bent) or info is None:
        return pixels, slopes
    axes = [views[tag].axis for tag in bent]
    ahead = np.array([one.directions for one in axes if one])
    back = np.linalg.pinv(np.array([one.to_pixels for one in axes if one]))
    points = ahead[:, None] + places[bent] @ np.swapaxes(back, 1, 2)
    uv, seen = project(points.reshape(-1, 3), info)
    uv[~seen] = np.nan
    pixels[bent] = uv.reshape(points[..., :2].shape)
    lengths = np.linalg.norm(points, axis=-1)[..., None, None]
    slopes[bent] = rays_of(pixels[bent], info).to_pixels @ back[:, None] / lengths
    return pixels, slopes


def block_diagonal(blocks: Floats) -> Floats:
    """(T, 2N, 2N) block diagonal matrices of blocks (T, N, 2, 2)."""
    tags, count = blocks.shape[:2]
    found = np.zeros((tags, count, 2, count, 2))
    every = np.arange(count)
    found[:, every, :, every] = blocks.transpose(1, 0, 2, 3)
    return found.reshape(tags, 2 * count, 2 * count)
