"""A film with what was measured beside it, as one thing to play."""

from __future__ import annotations

import heapq
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing
from typing import Any, NamedTuple

import numpy as np

from ros_visualise.sources.series import Series
from ros_visualise.sources.video import Video

_IMAGE = "image"


class Item(NamedTuple):
    """A message, and the name of the output that it is for."""

    output: str
    message: Any


class Film:
    """The images of a video, and the messages of series by the time in it."""

    def __init__(self, video: Video, series: Sequence[Series]) -> None:
        self._video, self._series = video, series

    @property
    def duration_ns(self) -> int | None:
        """That of the video."""
        return self._video.duration_ns

    def is_frame(self, item: Item) -> bool:
        """Whether a person steps to it: images are what is stepped through."""
        return item.output == _IMAGE

    def read(self, start_ns: int = 0) -> Generator[tuple[int, Item], None, None]:
        """(Time since the first frame, item), from the frame shown at ``start_ns`` on."""
        with closing(self._video.read(start_ns)) as frames:
            images = ((time_ns, Item(_IMAGE, image)) for time_ns, image in frames)
            first = next(images, None)
            if first is None:
                return
            yield first
            parts = [_measured(one, max(first[0], start_ns)) for one in self._series]
            yield from heapq.merge(images, *parts, key=lambda timed: timed[0])


def _measured(series: Series, start_ns: int) -> Iterator[tuple[int, Item]]:
    order = np.argsort(series.stamps_ns, kind="stable")
    begin = int(np.searchsorted(series.stamps_ns[order], start_ns))
    for index in order[begin:]:
        time_ns = max(int(series.stamps_ns[index]), 0)
        yield time_ns, Item(series.topic, series.make(int(index)))
