"""Keyframes of a camera, the points that these see, and what is known of their poses."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats, Pixels
from ros_visualise.estimation.visual.bundle import Mask
from ros_visualise.geometry import se3
from ros_visualise.vision.tracking import Ids


@dataclass(eq=False)
class Keyframe:
    """An image with its pose T_map_camera, and the directions in which it sees corners.

    ``ids`` (N,) are in order; ``rays`` (C, N, 2) are of each camera, NaN where it
    sees none; ``gray`` is the left image, undistorted.
    """

    key: int
    stamp_ns: int
    R: Floats
    p: Floats
    ids: Ids
    rays: Floats
    gray: Pixels

    def see(self, ids: Ids, rays: Floats) -> None:
        """Add corners."""
        ids = np.concatenate([self.ids, ids])
        order = np.argsort(ids)
        self.ids, self.rays = ids[order], np.concatenate([self.rays, rays], axis=1)[:, order]


class KeyframeDistance(NamedTuple):
    """A measured distance between two keyframes, with its standard deviation."""

    first: int
    second: int
    length: float
    sigma: float


@dataclass(eq=False)
class PosePrior:
    """Prior knowledge about keyframes: ``H x = g`` for the twists from their earlier poses."""

    keys: list[int]
    R: Floats
    p: Floats
    H: Floats
    g: Floats

    def at(self, R: Floats, p: Floats) -> tuple[Floats, float]:
        """The right side at other poses, and half of the sum of squares up to a constant."""
        back = np.swapaxes(self.R, 1, 2)
        turn = R @ back
        shift = p - (turn @ self.p[..., None])[..., 0]
        x = se3.logs(turn, shift).ravel()
        return self.g - self.H @ x, float(x @ self.H @ x / 2 - self.g @ x)


@dataclass(eq=False)
class MapPoints:
    """Points by number: their hosts, and (3,) as in `BundleScene`."""

    ids: Ids = field(default_factory=lambda: np.zeros(0, np.int64))
    host: Ids = field(default_factory=lambda: np.zeros(0, np.int64))  # keys of keyframes
    values: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    def chosen(self, kept: Mask) -> MapPoints:
        return MapPoints(self.ids[kept], self.host[kept], self.values[kept])

    def joined(self, other: MapPoints) -> MapPoints:
        ids = np.concatenate([self.ids, other.ids])
        order = np.argsort(ids)
        return MapPoints(
            ids[order],
            np.concatenate([self.host, other.host])[order],
            np.concatenate([self.values, other.values])[order],
        )
