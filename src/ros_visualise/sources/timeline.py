"""The time of a playback: all loops of a recording on one line, and the part that is played."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.rate import MAX_RATE, Clock

_LATE_NS = 100_000_000  # further behind than this, time is lost rather than caught up with


class PlaybackTimeline:
    """Goes on at a rate, and stands still while paused; its user holds a lock.

    Args:
        clock: the monotonic time drives the timeline, the wall time gives the stamps.
        rate: speed; with 0 nothing waits, and stamps start at zero.
        live_stamps: stamp messages with the wall time at which they are due, else with their
            place on the timeline.

    Attributes:
        last_ns: the place of the last message.
        is_fresh: the next message is shown at once, and time goes on from it.
        open_ns: the place whose messages are shown although it is paused, or None.

    Raises:
        ParameterError: the rate is not from 0 to `MAX_RATE`.
    """

    def __init__(self, clock: Clock, rate: float, live_stamps: bool) -> None:
        self._clock = clock
        self._live_stamps = live_stamps
        self.rate, self.running = _checked(rate), True
        self.last_ns = 0
        self.is_fresh = True
        self.open_ns: int | None = None
        self._due_at_ns = 0  # when the last message was due, in the clock's time
        self._cycle_ns = 0  # the place where the present loop starts
        self._awaited_ns: int | None = None  # the place of the next message, while it is awaited
        self._left_ns = 0  # the place that was reached when one was last awaited
        self._origin_ns: int | None = None  # the stamp of the line's start, once it has begun
        self._anchor = (0, 0)  # (monotonic time, place) that go together

    def begin(self) -> int:
        """The stamp of the timeline's start: the time of the first call."""
        if self._origin_ns is None:
            self._origin_ns = self._clock.now_ns() if self.rate else 0
        return self._origin_ns

    @property
    def stamp_ns(self) -> int:
        """The stamp of the last message."""
        return self._due_at_ns if self._live_stamps else self.begin() + self.last_ns

    @property
    def reached_ns(self) -> int:
        """The place reached now; it does not go beyond the next message."""
        if self._awaited_ns is None:
            return self._left_ns
        reached_ns = self._paced_ns(self._clock.monotonic_ns()) if self.rate else self.last_ns
        return max(self.last_ns, min(reached_ns, self._awaited_ns))

    def change(self, *, rate: float | None = None, running: bool | None = None) -> None:
        """Change rate or pause, from the place reached now on."""
        now_ns = self._clock.monotonic_ns()
        self._anchor = (now_ns, self._paced_ns(now_ns))
        self.rate = self.rate if rate is None else _checked(rate)
        self.running = self.running if running is None else running

    def begin_loop(self, length_ns: int) -> None:
        """Begin the next loop, so long after the start of the current one."""
        self._cycle_ns += length_ns

    def place_ns(self, time_ns: int) -> int:
        """The place of a time of the present loop."""
        return self._cycle_ns + time_ns

    def gap_ns(self, place_ns: int) -> int:
        """Time on the timeline from the last message to a place."""
        return 0 if self.is_fresh else place_ns - self.last_ns

    @contextmanager
    def awaiting(self, place_ns: int) -> Iterator[None]:
        """Let time go on up to the message of a place."""
        self._awaited_ns = None if self.is_fresh else place_ns
        try:
            yield
        finally:
            self._left_ns, self._awaited_ns = self.reached_ns, None

    def due_ns(self, place_ns: int, now_ns: int) -> int | None:
        """The monotonic time at which the message of a place is due; None while paused."""
        if self.is_fresh or place_ns == self.open_ns or (self.running and not self.rate):
            return now_ns
        if not self.running:
            return None
        then_ns, then_place_ns = self._anchor
        return then_ns + round((place_ns - then_place_ns) / self.rate)

    def put(self, place_ns: int, due_ns: int, now_ns: int) -> None:
        """Note that the message of a place is published now; both times are monotonic."""
        if now_ns == due_ns or now_ns - due_ns > _LATE_NS:
            self._anchor, due_ns = (now_ns, place_ns), now_ns
        self._due_at_ns = self._clock.now_ns() - (now_ns - due_ns)
        self.last_ns = self._left_ns = place_ns
        self.is_fresh = False

    def _paced_ns(self, now_ns: int) -> int:
        then_ns, place_ns = self._anchor
        return place_ns + round((now_ns - then_ns) * (self.rate if self.running else 0))


def _checked(rate: float) -> float:
    if not 0 <= rate <= MAX_RATE:
        raise ParameterError(f"rate={rate:g}: must be from 0 to {MAX_RATE}; 0 is unthrottled")
    return float(rate)


class PlayedPart:
    """The part of a recording that is played, between two times since its start, both included.

    Its user holds a lock.

    Attributes:
        begin_ns: beginning of the part.
        end_ns: end of the part; None: that of the recording.
        next_ns: time of the first message after the end, once the end was reached; else None.
    """

    def __init__(self, begin_s: float, end_s: float | None) -> None:
        self.set(begin_s, end_s)
        self.next_ns: int | None = None
        self._floor_ns = self._last_ns = 0
        self._is_first = True

    @property
    def span_s(self) -> tuple[float, float | None]:
        """Beginning and end, in seconds."""
        return self.begin_ns / 1e9, None if self.end_ns is None else self.end_ns / 1e9

    def set(self, begin_s: float, end_s: float | None) -> None:
        """Choose another part; raises ParameterError unless its end comes after its beginning."""
        begin_ns, end_ns = round(begin_s * 1e9), None if end_s is None else round(end_s * 1e9)
        if begin_ns < 0 or (end_ns is not None and end_ns <= begin_ns):
            raise ParameterError("the end of the playback range must be after its start")
        self.begin_ns, self.end_ns = begin_ns, end_ns

    def has(self, time_ns: int) -> bool:
        """True if a time lies in the part."""
        return self.begin_ns <= time_ns and (self.end_ns is None or time_ns <= self.end_ns)

    def enter(self, start_ns: int) -> None:
        """Begin to read somewhere, also outside of the part."""
        self._last_ns, self._floor_ns, self.next_ns = start_ns, 0, None
        self._is_first = True

    def begin_lap(self, length_ns: int) -> int:
        """Begin to read at the beginning again; returns the length of the lap that ends here.

        The first message then takes the place of the one that would have come next.

        Args:
            length_ns: length of the recording.
        """
        lap_ns = (length_ns if self.next_ns is None else self.next_ns) - self.begin_ns
        self.enter(self.begin_ns)
        self._floor_ns = self.begin_ns
        return max(lap_ns, 0)

    def place(self, time_ns: int) -> int:
        """Time at which a message is shown: not before the beginning of the lap."""
        return max(time_ns, self._floor_ns)

    def end_before(self, time_ns: int) -> bool:
        """True if the end lies between the last message and the next one, at a time.

        Never before the first one that is read: a part without messages shows that.
        """
        end_ns = None if self._is_first else self.end_ns
        is_end = end_ns is not None and self._last_ns <= end_ns < time_ns
        self.next_ns = time_ns if is_end else None
        return is_end

    def passed(self, time_ns: int) -> None:
        """Note that a message was shown."""
        self._last_ns = self._last_ns if self._is_first else time_ns
        self._is_first = False
