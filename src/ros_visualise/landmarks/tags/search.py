"""Where tags are looked for in a video: over the whole image now and then, else near the last."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ros_visualise.data import Floats, Pixels
from ros_visualise.landmarks.tags.finder import Region, Tag, TagFinder

_AROUND = 0.5  # of a tag's longest side: how far it may move beside what it moved last
_AROUND_PX = 24
_GRID = 8  # the finder compares tiles of 4 pixels: a part's are those of the whole image
_MOST = 0.5  # of the image: looking at more of it in parts takes longer than at all of it


@dataclass(frozen=True, eq=False)
class _PreviousTag:
    """A tag in the image before, and how far (2,) its middle had moved there, in pixels."""

    tag: Tag
    moved: Floats


class TagSearch:
    """Finds tags in the images of one camera, one after the other."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget: the next image has nothing to do with the last."""
        self._seen: list[_PreviousTag] = []
        self._left = 0  # images until the next look at everything

    def find(self, finder: TagFinder, gray: Pixels, every: int) -> tuple[Tag, ...]:
        """The tags in an image; every so many images it is looked over as a whole, from the first.

        It also is where a tag of the image before is not found near its place, so that only a tag
        that comes new may have to wait.

        Args:
            finder: that finds them.
            gray: (height, width) uint8.
            every: 1: always as a whole.
        """
        tags = self._near_the_last(finder, gray) if 0 < self._left < every else None
        if tags is None:
            tags = finder.find(gray)
            self._left = every
        self._left -= 1
        self._seen = [_PreviousTag(tag, self._moved(tag)) for tag in tags]
        return tags

    def _near_the_last(self, finder: TagFinder, gray: Pixels) -> tuple[Tag, ...] | None:
        """The tags around their last places; None where one of them is not there."""
        regions = self._regions(gray.shape)
        tags = finder.find(gray, regions) if regions else ()
        lost = Counter(one.tag.name for one in self._seen) - Counter(tag.name for tag in tags)
        return None if lost else tags

    def _moved(self, tag: Tag) -> Floats:
        """How far it has moved since the image before, if the nearest of its name is itself."""
        last = [one.tag.center_uv for one in self._seen if one.tag.name == tag.name]
        moves = [tag.center_uv - center for center in last]
        return min(moves, key=lambda move: float(np.hypot(*move)), default=np.zeros(2))

    def _regions(self, shape: tuple[int, ...]) -> list[Region]:
        """Parts that do not overlap, or the whole image where they are much of it."""
        height, width = shape[:2]
        parts = [_around(one.tag.corners_uv, one.moved, width, height) for one in self._seen]
        merged = _merge(parts)
        area = sum((right - left) * (bottom - top) for left, top, right, bottom in merged)
        return merged if area < _MOST * width * height else [(0, 0, width, height)]


def _around(corners: Floats, moved: Floats, width: int, height: int) -> Region:
    """Where a tag is, would be if it moved on as it did, and some way around."""
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    both = np.concatenate([corners, corners + moved])
    around = max(_AROUND * sides.max(), _AROUND_PX)
    left, top = (np.floor((both.min(axis=0) - around) / _GRID) * _GRID).astype(int).tolist()
    right, bottom = (np.ceil((both.max(axis=0) + around) / _GRID) * _GRID).astype(int).tolist()
    return max(left, 0), max(top, 0), min(right, width), min(bottom, height)


def _merge(parts: Sequence[Region]) -> list[Region]:
    """The same with those that overlap made one."""
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
