"""Playing a source: pause, step, seek, rate and loop, driven by page, command line and ROS."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing
from typing import TypeVar

from ros_visualise.sources.playable import Playable, time_before
from ros_visualise.sources.playback_controls import PlaybackControls
from ros_visualise.sources.played_length import check_start

T = TypeVar("T")


class Playback(PlaybackControls):
    """Decides when each message of a source is published; call it from any thread."""

    @property
    def has_played(self) -> bool:
        """At least one message was played."""
        return self._quota.frames > 0

    @property
    def epoch(self) -> int:
        """How often a person sent it elsewhere, known before the first message from there."""
        return self._epoch

    @property
    def laps(self) -> int:
        """How often it has looped; the stamps go on."""
        return self._laps

    def time_ns(self) -> int:
        """Time since the start of the source; while it plays, it goes on between messages."""
        with self._changed:
            return self._position_ns + self._line.reached_ns - self._line.last_ns

    def stamp_ns(self) -> int:
        """The stamp that goes with `time_ns`, where messages are stamped with their place."""
        with self._changed:
            return self._line.begin() + self._line.reached_ns

    def check_start(self, duration_ns: int | None) -> None:
        """Check that the start lies within the source.

        Raises:
            UsageError: the start lies after the end.
        """
        check_start(self._position_ns, duration_ns)

    def run(
        self, recording: Playable[T], is_frame: Callable[[T], bool] = lambda _: True
    ) -> Iterator[tuple[int, T]]:
        """(Stamp, item) of a recording, each at its time.

        Args:
            recording: what is played.
            is_frame: whether an item counts as a frame, for steps and for the number of frames;
                the others pass between them.
        """
        start_ns = self._begin(recording)
        while start_ns is not None:
            at_end = yield from self._play_from(start_ns, recording, is_frame)
            start_ns = self._next_start(recording, at_end)

    def follow(self, items: Iterable[T | None]) -> Iterator[T]:
        """The items of a live source; those that come while it is paused are dropped.

        ``items`` gives None now and then while there is nothing new, so that an end is noticed.
        """
        start_ns = self._clock.monotonic_ns()
        for item in items:
            live_ns = self._clock.monotonic_ns() - start_ns
            if self._closed or self._asked.reopen or self._quota.ends_within(live_ns):
                break
            if item is not None and self._passes_live(live_ns):
                yield item
        self._ended = not self._asked.reopen

    def _passes_live(self, live_ns: int) -> bool:
        with self._changed:
            passes = not self._suspended and (self._line.running or self._asked.steps > 0)
            self._asked.steps = max(0, self._asked.steps - 1)
            self._position_ns = live_ns
            self._quota.use(0, passes)
            return passes

    def _begin(self, recording: Playable[T]) -> int | None:
        with self._changed:
            self._line.begin()
            self._length.promised_ns, self._line.is_fresh = recording.duration_ns, True
            return None if self._closed else self._position_ns

    def _play_from(
        self, start_ns: int, recording: Playable[T], is_frame: Callable[[T], bool]
    ) -> Generator[tuple[int, T], None, bool]:
        """Play; returns whether the end was reached, of the recording or of the part."""
        with closing(recording.read(start_ns)) as items:
            for time_ns, item in items:
                if not self._wait_turn(self._marks.place(time_ns), is_frame(item)):
                    return self._marks.next_ns is not None
                yield self._line.stamp_ns, item
        return True

    def _wait_turn(self, time_ns: int, is_frame: bool) -> bool:
        """Wait until the message of that time is due; whether it may pass."""
        with self._changed:
            place_ns = self._line.place_ns(time_ns)
            gap_ns = self._line.gap_ns(place_ns)
            self._done = self._quota.ends_within(gap_ns)
            if self._done or not self._wait_until_due(place_ns, time_ns):
                return False
            self._marks.passed(time_ns)
            self._asked.steps = max(0, self._asked.steps - is_frame)
            if gap_ns and time_ns > self._position_ns:
                self._length.pass_message(gap_ns)
            self._quota.use(gap_ns, is_frame)
            self._position_ns = time_ns
            return True

    def _wait_until_due(self, place_ns: int, time_ns: int) -> bool:
        with self._line.awaiting(place_ns):
            while not (self._closed or self._asked.lead_away or self._marks.end_before(time_ns)):
                now_ns = self._clock.monotonic_ns()
                due_ns = self._due_ns(place_ns, now_ns)
                if due_ns is not None and due_ns <= now_ns:
                    self._line.put(place_ns, due_ns, now_ns)
                    return True
                self._clock.wait(self._changed, due_ns)
        return False

    def _due_ns(self, place_ns: int, now_ns: int) -> int | None:
        if self._suspended:
            return None
        return now_ns if self._asked.steps else self._line.due_ns(place_ns, now_ns)

    def _next_start(self, recording: Playable[T], at_end: bool) -> int | None:
        """The time to read from next; None to end."""
        with self._changed:
            if at_end:
                if self._marks.next_ns is None:
                    self._length.end(self._position_ns)
                self._wait_at_end()
            self._ended = self._closed or self._done or not self._wants_more()
            if self._ended or self._asked.reopen:
                return None
            if not self._asked.lead_away:
                return self._begin_loop()
            self._line.is_fresh = True
            self._epoch += 1
            position_ns, frames_back = self._asked.take_place(self._position_ns)
        start_ns = time_before(recording, position_ns, frames_back)
        self._marks.enter(start_ns)
        return start_ns

    def _wait_at_end(self) -> None:
        while self._hold and not (self._closed or self._done or self._wants_more()):
            self._ended, self._asked.steps = True, 0
            self._clock.wait(self._changed, None)

    def _wants_more(self) -> bool:
        loops = self._loop and (self._line.running or self._asked.steps > 0)
        return self._asked.lead_away or (self.has_played and (self._asked.start_over or loops))

    def _begin_loop(self) -> int:
        self._line.begin_loop(self._marks.begin_lap(self._length.promised_ns or 0))
        self._epoch += self._asked.start_over
        self._laps += not self._asked.start_over
        self._line.is_fresh, self._asked.start_over = self._asked.start_over, False
        return self._marks.begin_ns
