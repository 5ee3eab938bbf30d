"""Keyframes that see the same place again, and the similarity between them.

Places that look alike are many, and a wrong one bends the whole way. So a place counts as known
again only if corners all over the image lie where its points should be, if it is much more alike
than every other place, and if a second keyframe says the same.

Source: R. Mur-Artal, J. Tardos, ORB-SLAM2, IEEE T-RO 2017 (candidates, geometry, repetition).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Pixels
from ros_visualise.estimation.visual.views import (
    SeenPlace,
    inverse_depths,
    twist_covariance,
    view_from,
)
from ros_visualise.geometry import se3, similarity
from ros_visualise.geometry.similarity import Similarity
from ros_visualise.vision.places import PlaceIndex, find_features

_RECENT = 10  # keyframes before one that are no place of the past
_TRIED = 6  # places, by the index
_PARTNERS = (1, -1, 2, -2, 4, -4)  # keyframes beside one that show the depths of its corners
_SCALED = 12  # points with depths in both views
_OTHER = 0.5  # of the points that agree: another place with more makes a place ambiguous
_SAME = np.array([0.15, 0.08, 0.2])  # of the depth, rad, log scale: closures that agree
_BESIDE = 3  # keyframes, of the two that agree
_LOOP = 3.0, 0.5  # least way of a loop: in distances from its start to its end, and in depths


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
        focal = float(self._K[0, 0])
        found = view_from(a, self._inverse_depths(first), b, focal, 2 * self._K[:2, 2] + 1)
        scale = found and self._scale(second, found.pairs[:, 1], found.seen[:, 2])
        if found is None or scale is None:
            return None
        size, size_sigma = scale
        motion = similarity.inverse(Similarity(1 / size, found.R, found.t / size))
        shortest = max(_LOOP[0] * float(np.linalg.norm(motion.t)), _LOOP[1] * found.depth)
        if a.stretch == b.stretch and self._way(first, second) < shortest:
            return None  # the same sightings as those of the odometry
        covariance = np.zeros((7, 7))
        covariance[:6, :6] = twist_covariance(found.seen / size, focal)
        covariance[6, 6] = size_sigma**2
        return Closure(first, second, motion, covariance, len(found.seen), found.depth)

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
        if own.inverse is None:
            beside = [number + step for step in _PARTNERS if 0 <= number + step < len(self.places)]
            others = [self.places[n] for n in beside if self.places[n].stretch == own.stretch]
            own.inverse = inverse_depths(own, others, float(self._K[0, 0]))
        return own.inverse

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
