"""Keyframes that see the same place again, and the similarity between them.

Places that look alike are many, and a wrong one bends the whole way. So a place counts as known
again only if corners all over the image lie where its points should be, if it is much more alike
than every other place, and if a second keyframe says the same.

Source: R. Mur-Artal, J. Tardos, ORB-SLAM2, IEEE T-RO 2017 (candidates, geometry, repetition); V.
Lepetit et al., EPnP, IJCV 2009.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Pixels
from ros_visualise.estimation.visual.bundle import triangulated
from ros_visualise.estimation.visual.window import ALIKE
from ros_visualise.geometry import se3, similarity
from ros_visualise.geometry.similarity import Similarity
from ros_visualise.vision.places import (
    PlaceFeatures,
    PlaceIndex,
    find_features,
    match_features,
)

_RECENT = 10  # keyframes before one that are no place of the past
_TRIED = 6  # places, by the index
_PARTNERS = (1, -1, 2, -2, 4, -4)  # keyframes beside one that show the depths of its corners
_DEPTH = 0.1  # standard deviation of the inverse depth of a point, as a fraction of it
_OFF_PX = 3.0  # corners that agree
_SIGMA_PX = 1.0
_LEAST = 30  # points that agree
_SHARE = 0.35  # of the matched points
_CELLS, _COVERED = 4, 5  # cells of a grid in each direction, and those with points, at least
_SCALED = 12  # points with depths in both views
_OTHER = 0.5  # of the points that agree: another place with more makes a place ambiguous
_SAME = np.array([0.15, 0.08, 0.2])  # of the depth, rad, log scale: closures that agree
_BESIDE = 3  # keyframes, of the two that agree
_LOOP = 3.0, 0.5  # least way of a loop: in distances from its start to its end, and in depths


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


class Closure(NamedTuple):
    """Two keyframes that see the same: the pose and the scale of the later one in the earlier.

    Attributes:
        first, second: numbers of the keyframes.
        motion: similarity from the second camera to the first.
        covariance: (7, 7) of its twist, in the axes of the second camera.
        inliers: number of points that agree.
        depth: their median distance.
    """

    first: int
    second: int
    motion: Similarity
    covariance: Floats
    inliers: int
    depth: float


class RevisitFinder:
    """Collects keyframes, and finds those of the same places.

    Args:
        K: (3, 3) of their images, which have no distortion.

    Attributes:
        places: all keyframes, in order.
        ambiguous: number of keyframes that look like several places.
    """

    def __init__(self, K: Floats) -> None:
        self._K = K
        self.places: list[SeenPlace] = []
        self.ambiguous = 0

    def add(self, stamp_ns: int, stretch: int, gray: Pixels) -> None:
        """Add a keyframe's image (H, W), uint8."""
        features = find_features(gray)
        rays = (features.pixels_uv - self._K[:2, 2]) / np.diag(self._K)[:2]
        self.places.append(SeenPlace(stamp_ns, stretch, features, rays))

    def find(self) -> list[Closure]:
        """All places that were seen again, by two keyframes each, and three after a loss."""
        self._index = PlaceIndex()
        for place in self.places:
            self._index.add(place.features)
        several = (self._best(number) for number in range(len(self.places)))
        found = [one for one in several if one]
        return [one for one in found if self._is_repeated(one, found)]

    def _best(self, number: int) -> Closure | None:
        """The place that a keyframe sees again, if only one is like it."""
        new = self.places[number]
        candidates = self._index.find(new.features, number - _RECENT, _TRIED)
        several = [self._closure(one, number) for one in candidates]
        closures = sorted((one for one in several if one), key=lambda one: -one.inliers)
        if not closures:
            return None
        best = closures[0]
        for other in closures[1:]:
            is_other = not self._agree(best, other)
            if is_other and other.inliers > _OTHER * best.inliers:
                self.ambiguous += 1
                return None
        return best

    # geometry

    def _closure(self, first: int, second: int) -> Closure | None:
        """The motion between two keyframes, if their points agree."""
        a, b = self.places[first], self.places[second]
        pairs = match_features(a.features, b.features)
        depths = self._inverse_depths(first)
        pairs = pairs[depths[pairs[:, 0]] > 0]
        if len(pairs) < _LEAST:
            return None
        z = 1 / depths[pairs[:, 0]]
        points = np.insert(a.rays[pairs[:, 0]], 2, 1.0, axis=1) * z[:, None]
        pose = _locate(points, b.rays[pairs[:, 1]], _OFF_PX / self._K[0, 0])
        if pose is None:
            return None
        R, t, good = pose
        if len(good) < max(_LEAST, _SHARE * len(pairs)) or not self._is_spread(b, pairs[good, 1]):
            return None
        seen = points[good] @ R.T + t
        scale = self._scale(second, pairs[good, 1], seen[:, 2])
        if scale is None:
            return None
        size, size_sigma = scale
        motion = similarity.inverse(Similarity(1 / size, R, t / size))
        depth = float(np.median(z[good]))
        shortest = max(_LOOP[0] * float(np.linalg.norm(motion.t)), _LOOP[1] * depth)
        if a.stretch == b.stretch and self._way(first, second) < shortest:
            return None  # the same sightings as those of the odometry
        covariance = _covariance(seen / size, _SIGMA_PX / self._K[0, 0], size_sigma)
        return Closure(first, second, motion, covariance, len(good), depth)

    def _scale(
        self, second: int, features: npt.NDArray[np.intp], depths: Floats
    ) -> tuple[float, float] | None:
        """Units of the first map for one of the second, and the deviation of its logarithm."""
        inverse = self._inverse_depths(second)[features]
        known = inverse > 0
        if known.sum() < _SCALED:
            return None
        logs = np.log(depths[known] * inverse[known])
        middle = float(np.median(logs))
        spread = 1.4826 * float(np.median(np.abs(logs - middle)))
        return float(np.exp(middle)), 0.005 + 3 * spread / float(np.sqrt(known.sum()))

    def _inverse_depths(self, number: int) -> Floats:
        """Inverse depths of a keyframe's features by those beside it, 0 where unknown."""
        own = self.places[number]
        if own.inverse is not None:
            return own.inverse
        own.inverse = np.zeros(len(own.rays))
        best = np.full(len(own.rays), _DEPTH)
        sigma = _SIGMA_PX / self._K[0, 0]
        for step in _PARTNERS:
            if not 0 <= number + step < len(self.places):
                continue
            other = self.places[number + step]
            if other.stretch != own.stretch:
                continue
            pairs = match_features(own.features, other.features)
            R, p = other.R.T @ own.R, other.R.T @ (own.p - other.p)
            first, second = own.rays[pairs[:, 0]], other.rays[pairs[:, 1]]
            rho, factor = triangulated(R, p, first, second)
            seen = np.insert(first, 2, 1.0, axis=1) @ R.T + rho[:, None] * p
            off = np.linalg.norm(seen[:, :2] / seen[:, 2:] - second, axis=1)
            fraction = factor * sigma / np.where(rho > 1e-9, rho, np.inf)
            good = (rho > 1e-9) & (seen[:, 2] > 0) & (off < _OFF_PX * sigma)
            good &= fraction < best[pairs[:, 0]]
            at = pairs[good, 0]
            own.inverse[at], best[at] = rho[good], fraction[good]
        return own.inverse

    def _is_spread(self, place: SeenPlace, features: npt.NDArray[np.intp]) -> bool:
        """True if features are all over the image, not on one thing."""
        size = 2 * self._K[:2, 2] + 1
        cells = (place.features.pixels_uv[features] / size * _CELLS).astype(int)
        return len({*map(tuple, cells.tolist())}) >= _COVERED

    def _way(self, first: int, second: int) -> float:
        """Length of the way between two keyframes."""
        positions = [one.p for one in self.places[first : second + 1]]
        return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())

    # agreement

    def _is_repeated(self, one: Closure, others: Sequence[Closure]) -> bool:
        """True if other keyframes nearby say the same."""
        near = [other for other in others if 0 < abs(one.second - other.second) <= _BESIDE]
        is_after_loss = self.places[one.first].stretch != self.places[one.second].stretch
        return sum(self._agree(one, other) for other in near) >= (2 if is_after_loss else 1)

    def _agree(self, one: Closure, other: Closure) -> bool:
        """True if two closures place the camera alike, by the way within each part."""
        if self.places[one.first].stretch != self.places[other.first].stretch:
            return False
        if self.places[one.second].stretch != self.places[other.second].stretch:
            return False
        ahead = self._between(one.second, other.second)
        back = self._between(other.first, one.first)
        circle = similarity.product(
            similarity.product(one.motion, ahead),
            similarity.product(similarity.inverse(other.motion), back),
        )
        off = np.array(
            [
                np.linalg.norm(circle.t) / max(one.depth, other.depth),
                np.linalg.norm(se3.rotation_vector(circle.R)),
                abs(np.log(circle.s)),
            ]
        )
        return bool((off < _SAME).all())

    def _between(self, a: int, b: int) -> Similarity:
        """The pose of a keyframe in another one, by the odometry."""
        one, other = self.places[a], self.places[b]
        return Similarity(1.0, one.R.T @ other.R, one.R.T @ (other.p - one.p))


def _locate(
    points: Floats, rays: Floats, off: float
) -> tuple[Floats, Floats, npt.NDArray[np.intp]] | None:
    """The motion (R, t) from points to a camera that sees them at rays (N, 2), and which agree."""
    cv2.setRNGSeed(0)
    found, turn, shift, good = cv2.solvePnPRansac(
        points, rays, np.eye(3), None, iterationsCount=200, reprojectionError=off,
        flags=cv2.SOLVEPNP_AP3P,
    )  # fmt: skip
    if not found or good is None or len(good) < _LEAST:
        return None
    kept = np.asarray(good[:, 0], np.intp)
    for _ in range(2):
        turn, shift = cv2.solvePnPRefineLM(points[kept], rays[kept], np.eye(3), None, turn, shift)
        R = np.asarray(cv2.Rodrigues(turn)[0], np.float64)
        seen = points @ R.T + shift[:, 0]
        away = np.linalg.norm(seen[:, :2] / seen[:, 2:] - rays, axis=1)
        kept = np.flatnonzero((away < off) & (seen[:, 2] > 0))
        if len(kept) < _LEAST:
            return None
    return R, np.asarray(shift[:, 0], np.float64), kept


def _covariance(seen: Floats, sigma: float, size_sigma: float) -> Floats:
    """(7, 7) of the twist of a camera that sees points (N, 3), in its axes and units."""
    z = seen[:, 2]
    flat = np.zeros((len(z), 2, 3))
    flat[:, 0, 0] = flat[:, 1, 1] = 1 / z
    flat[:, :, 2] = -seen[:, :2] / z[:, None] ** 2
    J = np.concatenate([-flat, flat @ se3.cross(seen)], axis=2)
    H = np.einsum("nai,naj->ij", J, J) / sigma**2
    covariance = np.zeros((7, 7))
    covariance[:6, :6] = ALIKE * np.linalg.pinv(H, hermitian=True)
    covariance[6, 6] = size_sigma**2
    return covariance
