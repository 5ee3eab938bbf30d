"""Playing a source: pause, step, seek, rate, loop; driven by page, command line and ROS."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from typing import Any, NamedTuple, Protocol, TypeVar

from ros_visualise.core.errors import UsageError
from ros_visualise.core.rate import Clock, WallClock
from ros_visualise.sources.timeline import PlaybackTimeline, PlayedPart

log = logging.getLogger(__name__)

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)

_DEFAULT_PERIOD_NS = 33_333_333  # of a recording that holds a single message
_ROUNDING_NS = 1_000
_PATIENCE_NS, _IMPATIENCE_NS = 300_000_000, 1_000_000_000
"""In this span after the last message, what is read is shown though it is outdated."""
_REST_S = 0.05
"""After a message that is shown while paused, the processor is left to its images for this time."""


class Playable(Protocol[T_co]):
    """A source that can be read again from any time on."""

    @property
    def duration_ns(self) -> int | None:
        """Duration, if it is known; it may turn out to be wrong."""

    def read(self, start_ns: int) -> Generator[tuple[int, T_co], None, None]:
        """(Time since the start, item) in order of time, from the item shown at ``start_ns`` on.

        That is the last one not after ``start_ns``; past the end it is the last one of all.
        """


class PlaybackState(NamedTuple):
    """State of a playback as a page shows it; unknown times are None."""

    position_s: float
    duration_s: float | None
    playing: bool
    ended: bool
    rate: float
    loop: bool
    part_s: tuple[float, float | None]


class PlayedSource(NamedTuple):
    """One of several sources that are played together: its times, and by how much it is moved.

    ``name`` is that of its parameter; ``is_aligned``: by its stamps, before it was moved.
    """

    name: str
    title: str
    begin_s: float
    end_s: float
    is_aligned: bool


class RecordedTime(Protocol):
    """The line of time of a recording, whose messages keep their stamps."""

    def place_ns(self, stamp_ns: int) -> int:
        """The place of a stamp, from the start."""

    def stamp_ns(self, place_ns: int) -> int:
        """The stamp of a place."""


class Sought(NamedTuple):
    """A seek: its number, the number of messages and the position before it, and its target."""

    number: int
    played: int
    before_ns: int
    target_ns: int


class Playback:
    """Decides when each message of a source is published; call it from any thread.

    Args:
        rate: playback speed, up to 100; 0: as fast as possible, and stamps start at zero.
        loop: start again at the end; the stamps keep increasing.
        start_s: where to start.
        duration_s: how much to play in all, over loops and seeks.
        frames: how many messages to play in all.
        hold: at the end, wait for a seek or for `close`.
        part_s: beginning and end of the part that is played at first; see `set_part`.
        live_stamps: stamp each message with the clock's time at which it is due, as a camera would,
            rather than with its place in the recording.
        clock: measures time.

    Attributes:
        holds: it waits at the end.
        first_part_s: beginning and end of the part that is played unless a person changes it.
        closed: it was closed, so the source is to end.
        epoch: number of seeks and restarts so far, known before the first message after one.
        laps: number of loops so far; the stamps go on.
        live_stamps: messages are stamped with the clock's time.
        key_image: returns the time and the image of the key image before a time, ns; the source
            sets it; None: it is not a film.
        recorded: times of the recording that is played; None: messages are stamped by playback.
        sources: what is played together, if it is several.
        step_topics: topics of the source that can be stepped through, if it has several.
        step_topic: a step shows the next message of this topic; empty: of any.

    Raises:
        ParameterError: the rate is not from 0 to 100, or the part ends before it begins.
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
        part_s: tuple[float, float | None] = (0.0, None),
        live_stamps: bool = False,
        clock: Clock | None = None,
    ) -> None:
        self._clock = clock or WallClock()
        self._changed = threading.Condition()
        self._line = PlaybackTimeline(self._clock, rate, live_stamps)
        self._part = PlayedPart(*part_s)
        self.first_part_s = self._part.span_s
        self._requests = _Requests()
        self._quota = _Quota(duration_s, frames)
        self._loop, self.holds = loop, hold
        self.live_stamps = live_stamps
        self.laps = self.epoch = 0
        self.closed = self._suspended = False
        self._ended = False  # all is read and nothing more requested
        self._done = False  # the quota is used up
        self._length_ns: int | None = None  # as the source declares it, until its end is seen
        self._period_ns = 0
        self._position_ns = round(start_s * 1e9)
        self._heading_ns: int | None = None  # where it goes, until the first message there
        self.recorded: RecordedTime | None = None
        self.sources: tuple[PlayedSource, ...] = ()
        self.step_topics: tuple[str, ...] = ()
        self.step_topic = ""
        self.key_image: Callable[[int], tuple[int, Any] | None] | None = None
        self._sought = Sought(0, 0, 0, 0)
        self._passed_ns = 0  # when the last message passed

    @property
    def state(self) -> PlaybackState:
        """Present state."""
        with self._changed:
            target_ns, line = self._target_ns, self._line
            return PlaybackState(
                (self._position_ns if target_ns is None else target_ns) / 1e9,
                None if self._length_ns is None else self._length_ns / 1e9,
                line.running and not self._is_over,
                self._is_over,
                line.rate,
                self._loop,
                self._part.span_s,
            )

    @property
    def _is_over(self) -> bool:
        """True at the end, unless something is requested that is not carried out yet."""
        goes_on = self.holds and not (self._done or self.closed) and self._wants_more()
        return self._ended and not goes_on

    @property
    def _target_ns(self) -> int | None:
        """The time that was sought; None once a message has been shown there."""
        requested_ns = self._requests.target_ns
        return self._heading_ns if requested_ns is None else requested_ns

    @property
    def _place_ns(self) -> int:
        """The present place, or the one that was requested and is under way."""
        return self._position_ns if self._heading_ns is None else self._heading_ns

    @property
    def lead_s(self) -> float:
        """The beginning of the first source, if several are played together."""
        return self.sources[0].begin_s if self.sources else 0.0

    @property
    def is_outdated(self) -> bool:
        """True if what is being read is not wanted any more.

        False if nothing has passed for a while, so that a person who drags a slider sees images;
        where reading one takes longer, no seek waits for what an earlier one asked for.
        """
        if not self._requests.lead_away:
            return False
        since_ns = self._clock.monotonic_ns() - self._passed_ns
        return not _PATIENCE_NS <= since_ns < _IMPATIENCE_NS

    def await_seek(self, after: int, timeout_s: float) -> Sought | None:
        """The newest seek, if it comes after that number of them; None if none comes in time."""
        with self._changed:
            self._changed.wait_for(lambda: self._sought.number > after or self.closed, timeout_s)
            return self._sought if self._sought.number > after else None

    def is_awaited(self, seek: Sought) -> bool:
        """True for the newest seek, until the first message after it has passed."""
        return self._sought is seek and self._quota.frames == seek.played

    @property
    def has_played(self) -> bool:
        """True if at least one message was played."""
        return self._quota.frames > 0

    def time_ns(self) -> int:
        """Time since the start of the source; while it plays, it goes on between messages.

        From a request to seek until its first message, the requested time.
        """
        with self._changed:
            if self._target_ns is not None:
                return self._target_ns
            return self._position_ns + self._line.reached_ns - self._line.last_ns

    def stamp_ns(self) -> int:
        """The stamp that goes with `time_ns`, where messages are stamped with their place."""
        with self._changed:
            return self._line.begin() + self._line.reached_ns

    @property
    def start_stamp_ns(self) -> int:
        """The stamp of the source's start in the present loop, likewise."""
        with self._changed:
            return self._line.begin() + self._line.place_ns(0)

    def check_start(self, duration_ns: int | None) -> None:
        """Raise UsageError if the start lies after the end of the source."""
        if duration_ns and self._position_ns > duration_ns:
            start, end = self._position_ns / 1e9, duration_ns / 1e9
            raise UsageError(f"cannot start at {start:g} s: the source lasts only {end:.2f} s")

    def play(self) -> None:
        """Go on; at the end, start again."""
        with self._changing():
            self._line.change(running=True)
            self._requests.steps = 0
            self._requests.start_over |= self._is_over

    def pause(self) -> None:
        """Stop at the present message."""
        with self._changing():
            self._line.change(running=False)

    def toggle(self) -> None:
        """Pause or resume."""
        with self._changed:
            self.pause() if self.state.playing else self.play()

    def step(self, frames: int = 1) -> None:
        """Pause, and show a number of messages more; a negative number goes back."""
        with self._changing():
            self.pause()
            self._requests.step(frames)

    def seek(self, time_s: float) -> None:
        """Go to a time since the start; paused or at the end, it shows that message and waits."""
        with self._changing():
            if self._is_over:
                self._line.change(running=False)
            end_ns = math.inf if self._length_ns is None else self._length_ns
            target_ns = int(max(0, min(round(time_s * 1e9), end_ns)))
            self._requests.seek(target_ns)
            number, played = self._sought.number + 1, self._quota.frames
            self._sought = Sought(number, played, self._position_ns, target_ns)

    def set_rate(self, rate: float) -> None:
        """Change the speed at once; raises ParameterError unless it is from 0 to 100."""
        with self._changing():
            self._line.change(rate=rate)

    def set_loop(self, loop: bool) -> None:
        """Set whether playback loops."""
        with self._changing():
            self._loop = loop

    def suspend(self, suspended: bool) -> None:
        """Give no messages for now, whatever else is requested; what becomes due is dropped."""
        with self._changing():
            self._suspended = suspended

    def set_part(self, begin_s: float = 0.0, end_s: float | None = None) -> None:
        """Play what lies between two times, both included; seeking elsewhere stays possible.

        Raises:
            ParameterError: the end does not come after the beginning.
        """
        with self._changing():
            self._part.set(begin_s, end_s)
            target_ns = self._target_ns
            if not self._part.has(self._position_ns if target_ns is None else target_ns):
                self.seek(begin_s)

    def repeat(self, begin_s: float, end_s: float | None) -> None:
        """Play a part from its start, again and again; errors as of `set_part`."""
        with self._changing():
            self._loop = True  # before the rest: at the end, it then does not wait
            self.set_part(begin_s, end_s)
            self.seek(begin_s)

    def restart(self) -> None:
        """End the present run, as the source is to be opened anew; see `take_restart`."""
        with self._changing():
            self._requests.reopen = True

    def take_restart(self) -> bool:
        """True if the run ended because of a `restart`; asking clears that."""
        with self._changed:
            reopen, self._requests.reopen = self._requests.reopen, False
            return reopen and not self.closed

    def close(self) -> None:
        """End the source and every wait."""
        with self._changing():
            self.closed = True

    def run(
        self, recording: Playable[T], is_frame: Callable[[T], bool] = lambda _: True
    ) -> Iterator[tuple[int, T]]:
        """(Stamp, item) of a recording, each at its time.

        Args:
            recording: what is played.
            is_frame: true for items that count as frames, for steps and for the number of frames;
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
            if self.closed or self._requests.reopen or self._quota.ends_within(live_ns):
                break
            if item is not None and self._passes_live(live_ns):
                yield item
        self._ended = not self._requests.reopen

    @contextmanager
    def _changing(self) -> Iterator[None]:
        with self._changed:
            yield
            self._changed.notify_all()

    def _passes_live(self, live_ns: int) -> bool:
        with self._changed:
            passes = not self._suspended and (self._line.running or self._requests.steps > 0)
            self._requests.steps = max(0, self._requests.steps - 1)
            self._position_ns = live_ns
            self._quota.use(0, passes)
            return passes

    def _begin(self, recording: Playable[T]) -> int | None:
        with self._changed:
            self._line.begin()
            self._length_ns, self._line.is_fresh = recording.duration_ns, True
            return None if self.closed else self._place_ns

    def _play_from(
        self, start_ns: int, recording: Playable[T], is_frame: Callable[[T], bool]
    ) -> Generator[tuple[int, T], None, bool]:
        """Play; returns true if the end was reached, of the recording or of the part."""
        with closing(recording.read(start_ns)) as items:
            for time_ns, item in items:
                if not self._wait_turn(self._part.place(time_ns), is_frame(item)):
                    return self._part.next_ns is not None
                yield self._line.stamp_ns, item
                if not self._goes_on():
                    return False
        return True

    def _goes_on(self) -> bool:
        """True if the next message is to be read; while paused, that is known a little later."""
        with self._changed:
            is_paused = not (self._line.running or self._requests.steps or self.closed)
            if is_paused and self._line.open_ns is None and not self._requests.lead_away:
                self._changed.wait(_REST_S)
            return not (self.closed or self._requests.lead_away)

    def _wait_turn(self, time_ns: int, is_frame: bool) -> bool:
        """Wait until the message of that time is due; true if it may pass."""
        with self._changed:
            place_ns = self._line.place_ns(time_ns)
            is_first = self._line.is_fresh or place_ns == self._line.open_ns
            gap_ns = self._line.gap_ns(place_ns)
            self._done = self._quota.ends_within(gap_ns)
            if self._done or not self._wait_until_due(place_ns, time_ns):
                return False
            self._line.open_ns = place_ns if is_first and not is_frame else None
            self._part.passed(time_ns)
            if is_frame and not (is_first and self.epoch):  # not what was sought
                self._requests.steps = max(0, self._requests.steps - 1)
            if gap_ns and time_ns > self._position_ns:
                self._period_ns = gap_ns
            self._quota.use(gap_ns, is_frame)
            self._position_ns, self._heading_ns = time_ns, None
            self._passed_ns = self._clock.monotonic_ns()
            return True

    def _wait_until_due(self, place_ns: int, time_ns: int) -> bool:
        with self._line.awaiting(place_ns):
            while not (self.closed or self._requests.lead_away or self._part.end_before(time_ns)):
                now_ns = self._clock.monotonic_ns()
                due_ns = self._due_ns(place_ns, now_ns)
                if due_ns is not None and due_ns <= now_ns and self._has_time():
                    self._line.put(place_ns, due_ns, now_ns)
                    return True
                self._clock.wait(self._changed, due_ns)
        return False

    def _has_time(self) -> bool:
        """False until the clock, by which messages are stamped, has a time."""
        return not self._line.rate or self._clock.now_ns() > 0

    def _due_ns(self, place_ns: int, now_ns: int) -> int | None:
        if self._suspended:
            return None
        return now_ns if self._requests.steps else self._line.due_ns(place_ns, now_ns)

    def _next_start(self, recording: Playable[T], at_end: bool) -> int | None:
        """The time to read from next; None to end."""
        with self._changed:
            if at_end and not self._requests.lead_away:  # else it may only be outdated
                self._heading_ns = None
                if self._part.next_ns is None:
                    self._correct_length()
                self._wait_at_end()
            self._ended = self.closed or self._done or not self._wants_more()
            if self._ended or self._requests.reopen:
                return None
            if not self._requests.lead_away:
                return self._begin_loop()
            self._line.is_fresh = True
            self.epoch += 1
            position_ns, frames_back = self._requests.take_place(self._place_ns)
            self._heading_ns = position_ns
        start_ns = position_ns
        if frames_back and position_ns != self._position_ns:  # no message may have this time
            start_ns = _time_at(recording, position_ns)
        start_ns = _time_before(recording, start_ns, frames_back)
        with self._changed:
            self._heading_ns = start_ns
            self._part.enter(start_ns)
        return start_ns

    def _correct_length(self) -> None:
        """Take the present position for the end, unless the declared length is about right."""
        known_ns, period_ns = self._length_ns or 0, self._period_ns
        if not 0 < known_ns - self._position_ns <= (2 * period_ns or known_ns):
            self._length_ns = self._position_ns + (period_ns or _DEFAULT_PERIOD_NS)
        if self._part.begin_ns >= (self._length_ns or math.inf):  # nothing could be played
            log.warning("the playback range starts after the end of the source: it is cleared")
            is_first = self._part.span_s == self.first_part_s
            self._part.set(0, None)
            self.first_part_s = self._part.span_s if is_first else self.first_part_s

    def _wait_at_end(self) -> None:
        while self.holds and not (self.closed or self._done or self._wants_more()):
            self._ended, self._requests.steps = True, 0
            self._clock.wait(self._changed, None)

    def _wants_more(self) -> bool:
        loops = self._loop and (self._line.running or self._requests.steps > 0)
        starts = self._requests.start_over or loops
        return self._requests.lead_away or (self.has_played and starts)

    def _begin_loop(self) -> int:
        self._line.begin_loop(self._part.begin_lap(self._length_ns or 0))
        self.epoch += self._requests.start_over
        self.laps += not self._requests.start_over
        if self._requests.start_over:
            self._heading_ns = self._part.begin_ns
        self._line.is_fresh, self._requests.start_over = self._requests.start_over, False
        return self._part.begin_ns


class _Requests:
    """Steps, seeks and restarts that wait; its user holds a lock.

    Attributes:
        steps: how many more messages to show while paused.
        target_ns: the time to seek, if any.
        start_over: at the end, play from the start again.
        reopen: open the source anew.
    """

    def __init__(self) -> None:
        self.steps = 0
        self.target_ns: int | None = None
        self.start_over = self.reopen = False
        self._steps_back = 0

    @property
    def lead_away(self) -> bool:
        """True if something other than the next message is requested."""
        return self.reopen or self.target_ns is not None or self._steps_back > 0

    def step(self, frames: int) -> None:
        """Show so many messages more; back, those are not shown that still wait."""
        steps = self.steps + frames
        self.steps, self._steps_back = max(steps, 0), self._steps_back + max(-steps, 0)

    def seek(self, time_ns: int) -> None:
        """Go to a time; this cancels all steps."""
        self.target_ns = time_ns
        self.steps = self._steps_back = 0

    def take_place(self, position_ns: int) -> tuple[int, int]:
        """The time to go to from a position, and the number of messages to go back from it."""
        place = (position_ns if self.target_ns is None else self.target_ns), self._steps_back
        self.target_ns, self._steps_back, self.start_over = None, 0, False
        return place


class _Quota:
    """Limits of what is played in all, over loops and seeks; None: no limit.

    Attributes:
        frames: how many were played.
    """

    def __init__(self, duration_s: float | None, frames: int | None) -> None:
        self.frames = 0
        self._time_ns = 0
        self._most_ns = None if duration_s is None else round(duration_s * 1e9)
        self._most_frames = frames

    def ends_within(self, more_ns: int) -> bool:
        """True if the limit is reached, or will be within so much time."""
        if self._most_frames is not None and self.frames >= self._most_frames:
            return True
        return self._most_ns is not None and self._time_ns + more_ns >= self._most_ns - _ROUNDING_NS

    def use(self, time_ns: int, frames: int) -> None:
        self._time_ns += time_ns
        self.frames += frames


def _time_before(source: Playable[object], time_ns: int, items_back: int) -> int:
    """The time of the item a number of items before the one shown at a time; at least 0."""
    for _ in range(items_back):
        if time_ns <= 0:
            break
        time_ns = _time_at(source, max(0, time_ns - 1))
    return time_ns


def _time_at(source: Playable[object], time_ns: int) -> int:
    """The time of the item shown at a time."""
    with closing(source.read(time_ns)) as items:
        return next(items, (0, None))[0]
