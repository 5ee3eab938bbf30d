"""Limits on how much of a source is played."""

from __future__ import annotations

_ROUNDING_NS = 1_000


class Quota:
    """What may be played in all, over loops and seeks, and what was; None: no limit.

    Attributes:
        frames: how many were played.
    """

    def __init__(self, duration_s: float | None, frames: int | None) -> None:
        self.frames = 0
        self._time_ns = 0
        self._most_ns = None if duration_s is None else round(duration_s * 1e9)
        self._most_frames = frames

    def ends_within(self, more_ns: int) -> bool:
        """Whether the limit is reached, or will be within so much time."""
        if self._most_frames is not None and self.frames >= self._most_frames:
            return True
        return self._most_ns is not None and self._time_ns + more_ns >= self._most_ns - _ROUNDING_NS

    def use(self, time_ns: int, frames: int) -> None:
        """Count what was played."""
        self._time_ns += time_ns
        self.frames += frames
