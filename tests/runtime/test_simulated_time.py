"""Time that is published, and starts over, as that of a recording which is played in a loop."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Iterator

import pytest

from ros_visualise.core.rate import SimulatedClock
from ros_visualise.sources.playback import Playback

S = 10**9
FPS = 10


class Film:
    """A recording without an end."""

    duration_ns = None

    def read(self, start_ns: int) -> Iterator[tuple[int, int]]:
        return ((number * S // FPS, number) for number in itertools.count())


class Looping:
    """Two seconds, from 100 s on, again and again; each look takes ten milliseconds."""

    def __init__(self) -> None:
        self._looks = 0

    def __call__(self) -> int:
        self._looks += 1
        return 100 * S + self._looks % 200 * S // 100


def test_playing_goes_on_where_time_starts_over_and_says_so_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    playback = Playback(live_stamps=True, frames=60, clock=SimulatedClock(Looping()))
    with caplog.at_level(logging.WARNING):
        stamps = [stamp_ns for stamp_ns, _ in playback.run(Film())]
    assert len(stamps) == 60
    assert all(99 * S < stamp_ns < 102 * S for stamp_ns in stamps)
    jumps = [now for then, now in itertools.pairwise(stamps) if now < then]
    assert len(jumps) >= 2
    [said] = caplog.messages
    assert said.startswith("simulated time jumped back by 2.0 s")


def test_nothing_is_stamped_before_the_time_is_known() -> None:
    times = itertools.chain(itertools.repeat(0, 20), itertools.count(100 * S, S // 100))
    playback = Playback(live_stamps=True, frames=5, clock=SimulatedClock(lambda: next(times)))
    stamps = [stamp_ns for stamp_ns, _ in playback.run(Film())]
    assert len(stamps) == 5
    assert min(stamps) >= 100 * S


def test_small_steps_back_are_no_jump(caplog: pytest.LogCaptureFixture) -> None:
    """Two who publish one time disagree a little."""
    times = iter([0, 5 * S, 5 * S - S // 2, 6 * S])
    clock = SimulatedClock(lambda: next(times))
    assert [clock.monotonic_ns() for _ in range(4)] == [0, 5 * S, 5 * S, 6 * S + S // 2]
    assert not caplog.messages
