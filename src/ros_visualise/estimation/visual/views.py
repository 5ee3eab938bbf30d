"""Views that see the same things, by the features of their images: depths, and the motion between.

Source: V. Lepetit et al., EPnP, IJCV 2009; R. Mur-Artal, J. Tardos, ORB-SLAM2, IEEE T-RO 2017.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.estimation.visual.bundle import triangulated
from ros_visualise.estimation.visual.locating import ALIKE
from ros_visualise.geometry import se3
from ros_visualise.vision.places import PlaceFeatures, match_features

LEAST = 30
"""Points that agree, at least."""
SIGMA_PX = 1.0
"""Standard deviation of a feature."""
_TURNS = 4  # steps of a fit
_DEPTH = 0.1  # standard deviation of the inverse depth of a point, as a fraction of it
_OFF_PX = 3.0  # corners that agree
_SHARE = 0.35  # of the matched points
_CELLS, _COVERED = 4, 5  # cells of a grid in each direction, and those with points, at least


@dataclass(eq=False)
class SeenPlace:
    """A keyframe: when and by what it is known again.

    Attributes:
        stretch: number of the map that it is part of.
        R, p: T_map_camera, as soon as it changes no more.
        inverse: (N,) inverse depths of its features, and 0 where unknown; None: not computed.
    """

    stamp_ns: int
    stretch: int
    features: PlaceFeatures
    rays: Floats
    R: Floats = field(default_factory=lambda: np.eye(3))
    p: Floats = field(default_factory=lambda: np.zeros(3))
    inverse: Floats | None = None


class ViewFromPlace(NamedTuple):
    """The pose of a view, T_view_place, by the points of a place.

    Attributes:
        seen: (N, 3) the points that agree, in the view's axes.
        pairs: (N, 2) numbers of their features in the place and in the view.
        depth: their median distance from the place.
    """

    R: Floats
    t: Floats
    seen: Floats
    pairs: npt.NDArray[np.intp]
    depth: float


def inverse_depths(
    own: SeenPlace, others: Iterable[SeenPlace], focal: float, turn_rad: float = 0.0
) -> Floats:
    """(N,) inverse depths of a place's features by views beside it, 0 where unknown.

    Args:
        turn_rad: standard deviation of the rotation between two views, as of a camera on a gimbal.
    """
    inverse = np.zeros(len(own.rays))
    best = np.full(len(own.rays), _DEPTH)
    sigma = SIGMA_PX / focal
    for other in others:
        pairs = match_features(own.features, other.features)
        R, p = other.R.T @ own.R, other.R.T @ (own.p - other.p)
        first, second = own.rays[pairs[:, 0]], other.rays[pairs[:, 1]]
        if turn_rad and np.linalg.norm(p) > 0:
            R = _turned(R, p, first, second, sigma, turn_rad)
        rho, factor = triangulated(R, p, first, second)
        seen = np.insert(first, 2, 1.0, axis=1) @ R.T + rho[:, None] * p
        off = np.linalg.norm(seen[:, :2] / seen[:, 2:] - second, axis=1)
        fraction = factor * sigma / np.where(rho > 1e-9, rho, np.inf)
        good = (rho > 1e-9) & (seen[:, 2] > 0) & (off < _OFF_PX * sigma)
        good &= fraction < best[pairs[:, 0]]
        at = pairs[good, 0]
        inverse[at], best[at] = rho[good], fraction[good]
    return inverse


def _turned(
    R: Floats, p: Floats, first: Floats, second: Floats, sigma: float, turn_rad: float
) -> Floats:
    """The rotation near R with which directions (N, 2) lie on each other's epipolar lines."""
    way, y = p / np.linalg.norm(p), np.insert(second, 2, 1.0, axis=1)
    for _ in range(_TURNS):
        q = np.insert(first, 2, 1.0, axis=1) @ R.T
        normal = np.cross(way, q)
        length = np.maximum(np.linalg.norm(normal[:, :2], axis=1), 1e-9)
        off = (y * normal).sum(axis=1) / length
        J = np.cross(q, np.cross(y, way)) / length[:, None]
        w = 1 / (sigma**2 + off**2)  # Cauchy's rule: wrong matches are far off
        H = (J * w[:, None]).T @ J + np.eye(3) / turn_rad**2
        R = se3.exp(np.concatenate([np.zeros(3), -np.linalg.solve(H, J.T @ (w * off))]))[0] @ R
    return R


def view_from(
    place: SeenPlace, inverse: Floats, view: SeenPlace, focal: float, size: Floats
) -> ViewFromPlace | None:
    """The pose of a view by a place with inverse depths, if enough points all over it agree.

    Args:
        size: (2,) width and height of the view's image.
    """
    pairs = match_features(place.features, view.features)
    pairs = pairs[inverse[pairs[:, 0]] > 0]
    if len(pairs) < LEAST:
        return None
    z = 1 / inverse[pairs[:, 0]]
    points = np.insert(place.rays[pairs[:, 0]], 2, 1.0, axis=1) * z[:, None]
    pose = _locate(points, view.rays[pairs[:, 1]], _OFF_PX / focal)
    if pose is None:
        return None
    R, t, good = pose
    cells = (view.features.pixels_uv[pairs[good, 1]] / size * _CELLS).astype(int)
    is_spread = len({*map(tuple, cells.tolist())}) >= _COVERED
    if len(good) < max(LEAST, _SHARE * len(pairs)) or not is_spread:
        return None
    return ViewFromPlace(R, t, points[good] @ R.T + t, pairs[good], float(np.median(z[good])))


def twist_covariance(seen: Floats, focal: float) -> Floats:
    """(6, 6) of the twist of a view that sees points (N, 3), in its axes."""
    z = seen[:, 2]
    flat = np.zeros((len(z), 2, 3))
    flat[:, 0, 0] = flat[:, 1, 1] = 1 / z
    flat[:, :, 2] = -seen[:, :2] / z[:, None] ** 2
    J = np.concatenate([-flat, flat @ se3.cross(seen)], axis=2)
    H = np.einsum("nai,naj->ij", J, J) / (SIGMA_PX / focal) ** 2
    covariance: Floats = ALIKE * np.linalg.pinv(H, hermitian=True)
    return covariance


def _locate(
    points: Floats, rays: Floats, off: float
) -> tuple[Floats, Floats, npt.NDArray[np.intp]] | None:
    """The motion (R, t) from points to a camera that sees them at rays (N, 2), and which agree."""
    cv2.setRNGSeed(0)
    found, turn, shift, good = cv2.solvePnPRansac(
        points, rays, np.eye(3), None, iterationsCount=200, reprojectionError=off,
        flags=cv2.SOLVEPNP_AP3P,
    )  # fmt: skip
    if not found or good is None or len(good) < LEAST:
        return None
    kept = np.asarray(good[:, 0], np.intp)
    for _ in range(2):
        turn, shift = cv2.solvePnPRefineLM(points[kept], rays[kept], np.eye(3), None, turn, shift)
        R = np.asarray(cv2.Rodrigues(turn)[0], np.float64)
        seen = points @ R.T + shift[:, 0]
        away = np.linalg.norm(seen[:, :2] / seen[:, 2:] - rays, axis=1)
        kept = np.flatnonzero((away < off) & (seen[:, 2] > 0))
        if len(kept) < LEAST:
            return None
    return R, np.asarray(shift[:, 0], np.float64), kept
