"""The history of one frame in its parent."""

from __future__ import annotations

from bisect import bisect_left
from typing import NamedTuple

from ros_visualise.geometry.rigid import Pose, interpolate


class Sample(NamedTuple):
    """The frame's parent at a time, and T_parent_frame."""

    parent: str
    pose: Pose


class History:
    """The samples of one frame in order of time; of a static one only the last.

    Args:
        static: the transform is valid at all times.
        length_ns: samples older than the newest by more than this are dropped.
    """

    def __init__(self, static: bool, length_ns: float) -> None:
        self.static = static
        self._length_ns = length_ns
        self._stamps_ns: list[int] = []
        self._samples: list[Sample] = []

    @property
    def newest(self) -> Sample:
        """The newest sample."""
        return self._samples[-1]

    @property
    def span_ns(self) -> tuple[int, int]:
        """The times of its first and its newest sample."""
        return self._stamps_ns[0], self._stamps_ns[-1]

    def is_before(self, stamp_ns: int) -> bool:
        """Whether a time is older than the history: time jumped back."""
        return not self.static and stamp_ns < self._stamps_ns[-1] - self._length_ns

    def insert(self, stamp_ns: int, sample: Sample) -> None:
        """Add a sample at its place; it replaces another of the same time."""
        if self.static:
            self._stamps_ns, self._samples = [stamp_ns], [sample]
            return
        place = bisect_left(self._stamps_ns, stamp_ns)
        if place < len(self._stamps_ns) and self._stamps_ns[place] == stamp_ns:
            self._samples[place] = sample
            return
        self._stamps_ns.insert(place, stamp_ns)
        self._samples.insert(place, sample)
        self._forget()

    def at(self, stamp_ns: int, tolerance_ns: float) -> Sample | None:
        """The sample at a time, interpolated; None further than the tolerance from the span.

        Beyond its ends the nearest holds; between two parents the earlier does, as tf2 has it.
        """
        stamps_ns, samples = self._stamps_ns, self._samples
        if self.static:
            return samples[0]
        place = bisect_left(stamps_ns, stamp_ns)
        if place == len(stamps_ns):
            return samples[-1] if stamp_ns - stamps_ns[-1] <= tolerance_ns else None
        after = samples[place]
        if stamps_ns[place] == stamp_ns:
            return after
        if place == 0:
            return after if stamps_ns[0] - stamp_ns <= tolerance_ns else None
        before, start = samples[place - 1], stamps_ns[place - 1]
        if before.parent != after.parent:
            return before
        fraction = (stamp_ns - start) / (stamps_ns[place] - start)
        return Sample(before.parent, interpolate(before.pose, after.pose, fraction))

    def _forget(self) -> None:
        oldest_ns = self._stamps_ns[-1] - self._length_ns
        if self._stamps_ns[0] < oldest_ns:
            count = next(i for i, stamp in enumerate(self._stamps_ns) if stamp >= oldest_ns)
            del self._stamps_ns[:count], self._samples[:count]
