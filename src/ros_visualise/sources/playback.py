"""Playing a source: pause, step, seek, rate and loop, driven by page, command line and ROS."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from typing import TypeVar

from ros_visualise.rate import Clock, WallClock
from ros_visualise.sources.marks import Marks
from ros_visualise.sources.playable import Playable, PlaybackState, time_before
from ros_visualise.sources.played_length import PlayedLength, check_start
from ros_visualise.sources.quota import Quota
from ros_visualise.sources.requests import Requests
from ros_visualise.sources.timeline import Timeline

T = TypeVar("T")


class Playback:
    """Decides when each message of a source is published; call it from any thread.

    Args:
        rate: playback speed, up to 100; 0: as fast as possible, and stamps start at zero.
        loop: start again at the end; the stamps keep increasing.
        start_s: where to start.
        duration_s: how much to play in all, over loops and seeks.
        frames: how many messages to play in all.
        hold: at the end, wait to be sought or closed.
        live_stamps: stamp each message with the clock's time at which it is due, as a camera would,
            rather than with its place in the recording.
        clock: what tells the time.

    Raises:
        ParameterError: the rate is not from 0 to 100.
    """

    def __init__(
        self,
        *,
        rate: float = 1.0,
        loop: bool = False,
        start_s: float = 0.0,
        duration_s: float | None = None,
        frames: int | None = None,
        hold: bool = False,
        live_stamps: bool = False,
        clock: Clock | None = None,
    ) -> None:
        self._clock = clock or WallClock()
        self._changed = threading.Condition()
        self._line = Timeline(self._clock, rate, live_stamps)
        self._asked = Requests()
        self._quota = Quota(duration_s, frames)
        self._marks = Marks()
        self._loop, self._hold = loop, hold
        self._laps = self._epoch = 0
        self._closed = False
        self._ended = False  # all is read and nobody wants more
        self._done = False  # all that was asked for is played
        self._length = PlayedLength()
        self._position_ns = round(start_s * 1e9)
        self.step_topics: tuple[str, ...] = ()
        """Topics of the source that can be stepped through, where it has several."""
        self.step_topic = ""
        """The one of which a step shows the next message; empty: the next of any."""

    @property
    def closed(self) -> bool:
        """It was closed, so the source is to end."""
        return self._closed

    @property
    def holds(self) -> bool:
        """It waits at the end, as somebody watches."""
        return self._hold

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

    @property
    def state(self) -> PlaybackState:
        """Its present state."""
        with self._changed:
            target_ns, line = self._asked.target_ns, self._line
            position_s = (self._position_ns if target_ns is None else target_ns) / 1e9
            playing, length_s = line.running and not self._ended, self._length.seconds
            return PlaybackState(
                position_s,
                length_s,
                playing,
                self._ended,
                line.rate,
                self._loop,
                self._marks.part_s,
            )

    def time_ns(self) -> int:
        """Time since the start of the source; while it plays, it goes on between messages."""
        with self._changed:
            return self._position_ns + self._line.reached_ns - self._line.last_ns

    def stamp_ns(self) -> int:
        """The stamp that goes with `time_ns`, where messages are stamped with their place."""
        with self._changed:
            return self._line.begin() + self._line.reached_ns

    def play(self) -> None:
        """Go on; at the end, start again."""
        with self._changing():
            self._line.change(running=True)
            self._asked.steps, self._asked.start_over = 0, self._ended

    def pause(self) -> None:
        """Stop at the present message."""
        with self._changing():
            self._line.change(running=False)

    def toggle(self) -> None:
        """Pause or go on."""
        with self._changed:
            self.pause() if self.state.playing else self.play()

    def step(self, frames: int = 1) -> None:
        """Pause, and show a number of messages more; a negative number goes back."""
        with self._changing():
            self.pause()
            self._asked.step(frames)

    def seek(self, time_s: float) -> None:
        """Go to a time since the start; if it is paused, the message of that time is shown."""
        with self._changing():
            self._asked.seek(self._length.within(round(time_s * 1e9)))

    def set_rate(self, rate: float) -> None:
        """Change the speed, at once.

        Raises:
            ParameterError: it is not from 0 to 100.
        """
        with self._changing():
            self._line.change(rate=rate)

    def set_loop(self, loop: bool) -> None:
        """Start again at the end, or not."""
        with self._changing():
            self._loop = loop

    def set_part(self, begin_s: float = 0.0, end_s: float | None = None) -> None:
        """Play what lies between two times, both included; a person may still seek elsewhere.

        Raises:
            ParameterError: the end does not come after the beginning.
        """
        with self._changing():
            end_ns = None if end_s is None else round(end_s * 1e9)
            self._marks.set(round(begin_s * 1e9), end_ns)
            if not self._marks.has(self._position_ns):
                self._asked.seek(self._marks.begin_ns)

    def restart(self) -> None:
        """End the present run, as the source is to be opened anew; see `take_restart`."""
        with self._changing():
            self._asked.reopen = True

    def take_restart(self) -> bool:
        """Whether the run ended because of a `restart`; asking clears that."""
        with self._changed:
            reopen, self._asked.reopen = self._asked.reopen, False
            return reopen and not self._closed

    def close(self) -> None:
        """End the source and every wait."""
        with self._changing():
            self._closed = True

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

    @contextmanager
    def _changing(self) -> Iterator[None]:
        with self._changed:
            yield
            self._changed.notify_all()

    def _passes_live(self, live_ns: int) -> bool:
        with self._changed:
            passes = self._line.running or self._asked.steps > 0
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
                due_ns = now_ns if self._asked.steps else self._line.due_ns(place_ns, now_ns)
                if due_ns is not None and due_ns <= now_ns:
                    self._line.put(place_ns, due_ns, now_ns)
                    return True
                self._clock.wait(self._changed, due_ns)
        return False

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
