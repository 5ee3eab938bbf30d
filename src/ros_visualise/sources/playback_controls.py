"""What people drive a playback by: play, pause, step, seek, rate, loop and marks."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from ros_visualise.core.rate import Clock, WallClock
from ros_visualise.sources.marks import Marks
from ros_visualise.sources.playable import PlaybackState
from ros_visualise.sources.played_length import PlayedLength
from ros_visualise.sources.quota import Quota
from ros_visualise.sources.requests import Requests
from ros_visualise.sources.timeline import Timeline


class PlaybackControls:
    """Plays, pauses, steps and seeks; call it from any thread.

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
        self._closed = self._suspended = False
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

    def suspend(self, suspended: bool) -> None:
        """Give no messages for now, whatever else is asked for; what becomes due is let pass."""
        with self._changing():
            self._suspended = suspended

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

    @contextmanager
    def _changing(self) -> Iterator[None]:
        with self._changed:
            yield
            self._changed.notify_all()
