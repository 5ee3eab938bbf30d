"""Stamps of messages -> presentation times of a video."""

from __future__ import annotations

TICKS_PER_SECOND = 90_000
"""29.97 and 23.976 fps are whole numbers of them."""

_MAX_GAP = 3600 * TICKS_PER_SECOND


class Timeline:
    """Presentation times, from zero on and always increasing, that keep the gaps between stamps.

    Where the clock jumps - backwards, or more than an hour ahead - a message takes the usual time
    after the last one.

    Attributes:
        gap: what was last between two messages, in ticks.
    """

    def __init__(self) -> None:
        self.gap = TICKS_PER_SECOND // 30
        self._ticks: int | None = None
        self._stamp_ns = 0
        self._zero_ns = 0  # the stamp that would be at time zero

    def place(self, stamp_ns: int) -> int:
        """The time of the next message, in ticks."""
        if self._ticks is None:
            self._ticks, self._zero_ns = 0, stamp_ns
        else:
            self._ticks, last = self._next(stamp_ns, self._ticks), self._ticks
            self.gap = self._ticks - last
        self._stamp_ns = stamp_ns
        return self._ticks

    def _next(self, stamp_ns: int, last: int) -> int:
        ticks = _round((stamp_ns - self._zero_ns) * TICKS_PER_SECOND, 1_000_000_000)
        if stamp_ns <= self._stamp_ns or ticks - last > _MAX_GAP:
            ticks = last + self.gap
            self._zero_ns = stamp_ns - _round(ticks * 1_000_000_000, TICKS_PER_SECOND)
        return max(ticks, last + 1)


def _round(numerator: int, denominator: int) -> int:
    return (numerator + denominator // 2) // denominator
