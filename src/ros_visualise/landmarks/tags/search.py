"""Tag search in video: the whole image now and then, otherwise near the previous tags."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ros_visualise.data import CameraInfo, Floats, Pixels
from ros_visualise.landmarks.tags.finder import Region, Tag, TagFinder

_AROUND = 0.5  # margin around the predicted tag, in longest sides
_AROUND_PX = 24
_GRID = 8  # the finder compares tiles of 4 pixels: regions are aligned with them
_MOST = 0.5  # largest fraction of the image searched by regions; beyond, the whole is faster


@dataclass(frozen=True, eq=False)
class _PreviousTag:
    """A tag in the previous image, and the motion (2,) of its centre there, in pixels."""

    tag: Tag
    moved: Floats


class TagSearch:
    """Finds tags in consecutive images of one camera."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the previous image."""
        self._seen: list[_PreviousTag] = []
        self._left = 0  # images until the next full search

    def find(
        self, finder: TagFinder, gray: Pixels, every: int, info: CameraInfo | None = None
    ) -> tuple[Tag, ...]:
        """The tags in an image; the first and then every ``every``-th image is searched as a whole.

        The whole image is also searched when a previous tag is not found near its place, so only
        new tags may be found late.

        Args:
            finder: for the tags.
            gray: (height, width) uint8.
            every: 1: always search the whole image.
            info: the camera's calibration.
        """
        tags = self._near_the_last(finder, gray, info) if 0 < self._left < every else None
        if tags is None:
            tags = finder.find(gray, info=info)
            self._left = every
        self._left -= 1
        self._seen = [_PreviousTag(tag, self._moved(tag)) for tag in tags]
        return tags

    def _near_the_last(
        self, finder: TagFinder, gray: Pixels, info: CameraInfo | None
    ) -> tuple[Tag, ...] | None:
        """The tags near their previous places; None if one is missing."""
        regions = self._regions(gray.shape)
        tags = finder.find(gray, regions, info) if regions else ()
        lost = Counter(one.tag.name for one in self._seen) - Counter(tag.name for tag in tags)
        return None if lost else tags

    def _moved(self, tag: Tag) -> Floats:
        """Motion since the previous image, from the nearest tag of the same name."""
        last = [one.tag.center_uv for one in self._seen if one.tag.name == tag.name]
        moves = [tag.center_uv - center for center in last]
        return min(moves, key=lambda move: float(np.hypot(*move)), default=np.zeros(2))

    def _regions(self, shape: tuple[int, ...]) -> list[Region]:
        """Disjoint regions, or the whole image if they would be large."""
        height, width = shape[:2]
        parts = [_around(one.tag.corners_uv, one.moved, width, height) for one in self._seen]
        merged = _merge(parts)
        area = sum((right - left) * (bottom - top) for left, top, right, bottom in merged)
        return merged if area < _MOST * width * height else [(0, 0, width, height)]


def _around(corners: Floats, moved: Floats, width: int, height: int) -> Region:
    """Region around a tag's place and its prediction."""
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    both = np.concatenate([corners, corners + moved])
    around = max(_AROUND * sides.max(), _AROUND_PX)
    left, top = (np.floor((both.min(axis=0) - around) / _GRID) * _GRID).astype(int).tolist()
    right, bottom = (np.ceil((both.max(axis=0) + around) / _GRID) * _GRID).astype(int).tolist()
    return max(left, 0), max(top, 0), min(right, width), min(bottom, height)


def _merge(parts: Sequence[Region]) -> list[Region]:
    """The regions, with overlapping ones merged."""
    merged: list[Region] = []
    for part in parts:
        while True:
            touching = next((one for one in merged if _overlap(one, part)), None)
            if touching is None:
                break
            merged.remove(touching)
            (a, b, c, d), (e, f, g, h) = touching, part
            part = (min(a, e), min(b, f), max(c, g), max(d, h))
        merged.append(part)
    return merged


def _overlap(one: Region, other: Region) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
