"""How much of a source is to be played."""

from __future__ import annotations

_ROUNDING_NS = 1_000


class Quota:
    """What is to be played in all, over loops and seeks, and what was; None is without end.

    Attributes:
        frames: how many were played.
    """

    def __init__(self, duration_s: float | None, frames: int | None) -> None:
        self.frames = 0
        self._time_ns = 0
        self._most_ns = None if duration_s is None else round(duration_s * 1e9)
        self._most_frames = frames

    def ends_within(self, more_ns: int) -> bool:
        """Whether all is played, or will be before so much time has passed."""
        if self._most_frames is not None and self.frames >= self._most_frames:
            return True
        return self._most_ns is not None and self._time_ns + more_ns >= self._most_ns - _ROUNDING_NS

    def use(self, time_ns: int, frames: int) -> None:
        """So much more was played."""
        self._time_ns += time_ns
        self.frames += frames
