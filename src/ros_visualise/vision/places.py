"""Places known again by what they look like: features of images, and an index of them.

Features are ORB corners with binary descriptors. The index counts, for each image that it knows,
how many descriptors have the same bits as those of a new image: some bits are drawn once for each
table, descriptors of the same bits share a bucket, and full buckets tell little. So it needs no
vocabulary that was learned from other images.

Source: E. Rublee et al., ORB: an efficient alternative to SIFT or SURF, ICCV 2011; P. Indyk, R.
Motwani, Approximate nearest neighbors, STOC 1998 (bits as hashes); J. Sivic, A. Zisserman, Video
Google, ICCV 2003 (weights of rare words).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Pixels

_FEATURES = 600
_FAST = 10  # gray levels by which a corner differs
_BORDER = 16  # pixels of the image's border without features
_LEVELS = 6
_TABLES, _BITS = 12, 18
_FULL = 100  # images in a bucket that tells nothing
_FAR = 60  # differing bits of descriptors that are no match
_RATIO = 0.9  # of the differing bits of the best and of the second-best match

Descriptors = npt.NDArray[np.uint8]
Words = npt.NDArray[np.int32]


class PlaceFeatures(NamedTuple):
    """Features of an image: pixels (N, 2) and descriptors (N, 32)."""

    pixels_uv: Floats
    descriptors: Descriptors


def find_features(gray: Pixels) -> PlaceFeatures:
    """The features of an image (H, W), uint8."""
    create: Any = cv2.ORB_create  # type: ignore[attr-defined]
    orb = create(_FEATURES, 1.2, _LEVELS, edgeThreshold=_BORDER, fastThreshold=_FAST)
    corners, descriptors = orb.detectAndCompute(gray, None)
    if descriptors is None:
        return PlaceFeatures(np.zeros((0, 2)), np.zeros((0, 32), np.uint8))
    return PlaceFeatures(np.array([one.pt for one in corners], np.float64), descriptors)


def match_features(first: PlaceFeatures, second: PlaceFeatures) -> npt.NDArray[np.intp]:
    """(M, 2) places of the same features in two images, each at most once."""
    if len(first.descriptors) < 2 or len(second.descriptors) < 2:
        return np.zeros((0, 2), np.intp)
    there = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(first.descriptors, second.descriptors, k=2)
    good = [
        (best.queryIdx, best.trainIdx, best.distance)
        for best, other in there
        if best.distance <= _FAR and best.distance < _RATIO * other.distance
    ]
    nearest: dict[int, tuple[float, int]] = {}
    for a, b, distance in good:
        nearest[b] = min(nearest.get(b, (np.inf, -1)), (distance, a))
    return np.array([(a, b) for b, (_, a) in nearest.items()], np.intp).reshape(-1, 2)


class PlaceIndex:
    """See the module. Images are numbered in the order in which they are added.

    Attributes:
        count: number of images that were added.
    """

    def __init__(self) -> None:
        drawn = np.random.default_rng(0)
        self._bits = np.stack([drawn.permutation(256)[:_BITS] for _ in range(_TABLES)])
        self.count = 0
        self._added: list[tuple[int, Words]] = []
        self._sorted: tuple[Words, Words] = np.zeros(0, np.int32), np.zeros(0, np.int32)

    def add(self, features: PlaceFeatures) -> int:
        """Add an image; its number."""
        self._added.append((self.count, self._words(features)))
        self.count += 1
        return self.count - 1

    def drop(self, number: int) -> None:
        """Forget an image."""
        words, owners = self._buckets()
        kept = owners != number
        self._sorted = words[kept], owners[kept]

    def find(self, features: PlaceFeatures, before: int, most: int) -> list[int]:
        """Numbers below ``before`` of the images most like this one, the best first."""
        words, numbers = self._buckets()
        wanted = self._words(features)
        start, end = (np.searchsorted(words, wanted, side) for side in ("left", "right"))
        counts = end - start
        rare = (counts > 0) & (counts < _FULL)
        start, counts = start[rare], counts[rare]
        if before <= 0 or not len(counts):
            return []
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        found = numbers[np.repeat(start, counts) + within]
        score = np.bincount(found, np.repeat(1 / counts, counts), minlength=before)[:before]
        best = np.argsort(-score, kind="stable")[:most]
        return [int(one) for one in best if score[one] > 0]

    def _buckets(self) -> tuple[Words, Words]:
        """The words of all images, in order, and the image of each."""
        if self._added:
            words = np.concatenate([self._sorted[0], *(one for _, one in self._added)])
            own = [np.full(len(one), number, np.int32) for number, one in self._added]
            order = np.argsort(words, kind="stable")  # quick, as its parts are in order
            self._sorted = words[order], np.concatenate([self._sorted[1], *own])[order]
            self._added = []
        return self._sorted

    def _words(self, features: PlaceFeatures) -> Words:
        """The buckets of an image, each once."""
        bits = np.unpackbits(features.descriptors, axis=1)[:, self._bits].astype(np.int32)
        powers = 1 << np.arange(_BITS, dtype=np.int32)
        words = bits @ powers + (np.arange(_TABLES, dtype=np.int32) << _BITS)
        return np.unique(words)
