"""A line of time that passes at a rate of the clock's, and stands still while paused."""

from __future__ import annotations

from ros_visualise.rate import Clock


class Timeline:
    """Where playing has come to; whoever uses it holds a lock.

    Args:
        clock: its monotonic time drives the line.
        rate: speed of the line; 0 does not pace at all.
    """

    def __init__(self, clock: Clock, rate: float) -> None:
        self._clock = clock
        self.rate = rate
        self.running = True
        self._anchor = (0, 0)  # (monotonic time, place on the line) that go together

    def put(self, line_ns: int) -> None:
        """That place is reached now."""
        self._anchor = (self._clock.monotonic_ns(), line_ns)

    def place_ns(self) -> int:
        """The place that is reached now."""
        then_ns, line_ns = self._anchor
        speed = self.rate if self.running else 0
        return line_ns + round((self._clock.monotonic_ns() - then_ns) * speed)

    def change(self, rate: float, running: bool) -> None:
        """Go on from the place reached by now, otherwise."""
        self.put(self.place_ns())
        self.rate, self.running = rate, running

    def due_ns(self, line_ns: int) -> int:
        """The monotonic time at which a place is reached; the rate is not 0."""
        then_ns, then_line_ns = self._anchor
        return then_ns + round((line_ns - then_line_ns) / self.rate)
