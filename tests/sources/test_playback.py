"""Playing: when each message passes, and what page, command line and ROS do to that."""

import threading
from collections.abc import Callable, Generator

import pytest
from waiting import wait_for

from ros_visualise.core.errors import ParameterError
from ros_visualise.sources.playback import Playback

S = 10**9
WALL = 1_700_000_000 * S


class FakeClock:
    """Time passes only by waiting; what is to happen meanwhile is told by ``at``."""

    def __init__(self) -> None:
        self.time_ns = 0
        self._events: list[tuple[int, Callable[[], None]]] = []

    def at(self, time_s: float, action: Callable[[], None]) -> None:
        self._events.append((round(time_s * S), action))
        self._events.sort(key=lambda event: event[0])

    def now_ns(self) -> int:
        return WALL + self.time_ns

    def monotonic_ns(self) -> int:
        return self.time_ns

    def wait(self, condition: threading.Condition, until_ns: int | None) -> None:
        due = [e for e in self._events if until_ns is None or e[0] <= until_ns]
        if not due:
            assert until_ns is not None, "waits for ever"
            self.time_ns = max(self.time_ns, until_ns)
            return
        self._events.remove(due[0])
        self.time_ns = max(self.time_ns, due[0][0])
        due[0][1]()


class Frames:
    """A recording of numbered messages at given times."""

    def __init__(self, times_s: list[float], promised_s: float | None = None) -> None:
        self.times_ns = [round(t * S) for t in times_s]
        self.duration_ns = None if promised_s is None else round(promised_s * S)

    def read(self, start_ns: int) -> Generator[tuple[int, int], None, None]:
        first = max([i for i, t in enumerate(self.times_ns) if t <= start_ns], default=0)
        yield from list(zip(self.times_ns, range(len(self.times_ns)), strict=True))[first:]


def regular(count: int, fps: int = 10) -> Frames:
    return Frames([i / fps for i in range(count)], count / fps)


def play(playback: Playback, recording: Frames, clock: FakeClock) -> list[tuple[float, int]]:
    """(Clock's time in seconds, frame) of all that passes."""
    return [(clock.time_ns / S, item) for _, item in playback.run(recording)]


@pytest.fixture
def clock() -> FakeClock:
    return FakeClock()


def test_messages_pass_at_their_own_times(clock: FakeClock) -> None:
    times = [0.0, 0.1, 0.15, 0.9, 1.0]
    assert play(Playback(clock=clock), Frames(times), clock) == list(
        zip(times, range(5), strict=True)
    )


def test_stamps_start_now_and_follow_the_recording_at_any_rate(clock: FakeClock) -> None:
    playback = Playback(rate=2, clock=clock)
    passed = [(clock.time_ns, stamp) for stamp, _ in playback.run(Frames([0, 0.5, 0.75]))]
    assert passed == [
        (0, WALL),
        (S // 4, WALL + S // 2),
        (3 * S // 8, WALL + 3 * S // 4),
    ]


def test_rate_zero_waits_for_nothing_and_stamps_from_zero(clock: FakeClock) -> None:
    stamps = [stamp for stamp, _ in Playback(rate=0, clock=clock).run(regular(5))]
    assert stamps == [0, S // 10, 2 * S // 10, 3 * S // 10, 4 * S // 10]
    assert clock.time_ns == 0


def test_loops_continue_the_stamps_by_the_length_with_the_last_period(clock: FakeClock) -> None:
    playback = Playback(loop=True, frames=7, clock=clock)
    passed = [(clock.time_ns, stamp - WALL, i) for stamp, i in playback.run(regular(3))]
    tenth = S // 10
    assert passed == [(n * tenth, n * tenth, n % 3) for n in range(7)]


def test_a_jump_counts_before_the_first_message_from_there(clock: FakeClock) -> None:
    looped = Playback(loop=True, frames=7, clock=clock)
    assert looped.laps == 0
    assert [looped.laps for _ in looped.run(regular(3))] == [0, 0, 0, 1, 1, 1, 2]
    sought = Playback(clock=clock)
    jumps = []
    for _, frame in sought.run(regular(9)):
        jumps.append(sought.epoch)
        if frame == 2:
            sought.seek(0.7)
    assert jumps == [0, 0, 0, 1, 1]


def test_an_empty_recording_ends_under_loop(clock: FakeClock) -> None:
    assert play(Playback(loop=True, clock=clock), Frames([]), clock) == []


@pytest.mark.parametrize("loop", [False, True])
def test_duration_is_what_is_played_in_all(clock: FakeClock, loop: bool) -> None:
    playback = Playback(rate=0, loop=loop, start_s=0.55, duration_s=0.7, hold=True, clock=clock)
    recording = regular(8) if loop else regular(50)
    expected = [5, 6, 7, 0, 1, 2, 3] if loop else [5, 6, 7, 8, 9, 10, 11]
    assert [i for _, i in playback.run(recording)] == expected
    assert playback.state.ended


def test_duration_does_not_count_what_a_seek_leaps_over(clock: FakeClock) -> None:
    playback = Playback(duration_s=0.5, clock=clock)
    clock.at(0.15, lambda: playback.seek(5))
    assert [i for _, i in play(playback, regular(100), clock)] == [0, 1, 50, 51, 52, 53]


def test_frames_end_it_though_it_holds(clock: FakeClock) -> None:
    assert len(play(Playback(frames=3, hold=True, clock=clock), regular(10), clock)) == 3
    assert play(Playback(frames=0, clock=clock), regular(10), clock) == []


def test_pause_stops_time_and_play_goes_on_from_there(clock: FakeClock) -> None:
    playback = Playback(clock=clock)
    clock.at(0.14, playback.pause)
    clock.at(5.0, playback.play)
    assert play(playback, regular(4), clock) == [(0, 0), (0.1, 1), (5.06, 2), (5.16, 3)]


def test_toggle_pauses_and_plays(clock: FakeClock) -> None:
    playback = Playback(clock=clock)
    seen = []
    clock.at(0.05, lambda: (playback.toggle(), seen.append(playback.state.playing)))
    clock.at(0.06, lambda: (playback.toggle(), seen.append(playback.state.playing)))
    play(playback, regular(3), clock)
    assert seen == [False, True]


def test_steps_show_the_next_messages_and_stay_paused(clock: FakeClock) -> None:
    playback = Playback(clock=clock)
    clock.at(0.05, lambda: playback.step())
    clock.at(1.0, lambda: playback.step(2))
    clock.at(2.0, lambda: playback.step(-1))
    clock.at(3.0, lambda: playback.step(-2))
    clock.at(4.0, playback.close)
    passed = play(playback, regular(10), clock)
    assert passed == [(0, 0), (0.05, 1), (1, 2), (1, 3), (2, 2), (3, 0)]


def test_steps_back_follow_irregular_times_and_stop_at_the_first(clock: FakeClock) -> None:
    playback = Playback(start_s=0.95, clock=clock)
    playback.pause()
    for time_s in (1, 2, 3, 4):
        clock.at(time_s, lambda: playback.step(-1))
    clock.at(5, playback.close)
    passed = play(playback, Frames([0, 0.3, 0.9, 1.0]), clock)
    assert [i for _, i in passed] == [2, 1, 0, 0, 0]


def test_seek_while_paused_shows_the_message_of_that_time(clock: FakeClock) -> None:
    playback = Playback(clock=clock)
    clock.at(0.05, playback.pause)
    clock.at(1, lambda: playback.seek(0.57))
    clock.at(2, lambda: playback.seek(0.2))
    clock.at(3, lambda: playback.seek(-7))
    clock.at(4, playback.close)
    assert play(playback, regular(10), clock) == [(0, 0), (1, 5), (2, 2), (3, 0)]


def test_what_goes_with_a_frame_is_shown_with_it_while_paused(clock: FakeClock) -> None:
    class Measured(Frames):
        def read(self, start_ns: int) -> Generator[tuple[int, int], None, None]:
            yield from ((time_ns, i) for i, time_ns in enumerate(self.times_ns))

    playback = Playback(clock=clock)
    playback.pause()
    clock.at(1, lambda: playback.seek(0))
    clock.at(2, playback.close)
    items = playback.run(Measured([0, 0, 0, 0, 0.1]), lambda item: item == 2)
    assert [item for _, item in items] == [0, 1, 2, 0, 1, 2]


def test_seek_past_the_end_shows_the_last(clock: FakeClock) -> None:
    playback = Playback(hold=True, clock=clock)
    clock.at(0.05, lambda: playback.seek(1e6))
    clock.at(1, playback.close)
    assert [i for _, i in play(playback, regular(10), clock)] == [0, 9]


def test_a_seek_while_playing_goes_on_from_there_at_once(clock: FakeClock) -> None:
    playback = Playback(clock=clock)
    clock.at(0.12, lambda: playback.seek(0.7))
    passed = play(playback, regular(10), clock)
    assert passed == [(0, 0), (0.1, 1), (0.12, 7), (0.22, 8), (0.32, 9)]


def test_position_is_the_target_at_once(clock: FakeClock) -> None:
    playback = Playback(clock=clock)
    playback.pause()
    run = playback.run(regular(10))
    next(run)
    playback.seek(0.6)
    assert (playback.state.position_s, playback.time_ns()) == (0.6, 600_000_000)
    next(run)
    assert (playback.state.position_s, playback.time_ns()) == (0.6, 600_000_000)


class Spied(Frames):
    """Notes the place of a playback whenever it is about to give a message."""

    def __init__(self, times_s: list[float], playback: Playback) -> None:
        super().__init__(times_s)
        self.playback = playback
        self.places: list[tuple[float, float]] = []
        self.once_read: Callable[[], None] = lambda: None

    def read(self, start_ns: int) -> Generator[tuple[int, int], None, None]:
        for item in super().read(start_ns):
            self.places.append((self.playback.state.position_s, self.playback.time_ns() / S))
            self.once_read()
            yield item


def begun(clock: FakeClock) -> tuple[Playback, Spied, Generator[tuple[int, int], None, None]]:
    """A playback that has shown the first of four messages."""
    playback = Playback(hold=True, clock=clock)
    frames = Spied([0, 0.1, 0.2, 0.3], playback)
    run = playback.run(frames)
    next(run)
    return playback, frames, run


def test_the_position_is_the_target_while_its_message_is_read(clock: FakeClock) -> None:
    playback, frames, run = begun(clock)
    playback.pause()
    playback.seek(0.3)
    next(run)
    assert frames.places[1:] == [(0.3, 0.3)]
    assert (playback.state.position_s, playback.time_ns()) == (0.3, 3 * S // 10)


def test_a_step_back_while_another_is_read_goes_on_from_that_one(clock: FakeClock) -> None:
    playback, frames, run = begun(clock)
    playback.seek(0.3)
    assert next(run)[1] == 3
    playback.step(-1)
    again = iter([lambda: None, lambda: playback.step(-1)])  # a step reads the one before it first
    frames.once_read = lambda: next(again, lambda: None)()
    assert next(run)[1] == 1


def test_a_restart_while_a_sought_message_is_read_goes_there(clock: FakeClock) -> None:
    playback, frames, run = begun(clock)
    playback.seek(0.2)
    frames.once_read = playback.restart
    assert list(run) == []
    assert playback.take_restart()
    assert next(playback.run(Frames([0, 0.1, 0.2, 0.3])))[1] == 2


def test_a_change_of_rate_takes_effect_within_a_wait(clock: FakeClock) -> None:
    playback = Playback(clock=clock)
    clock.at(0.5, lambda: playback.set_rate(2))
    clock.at(1.0, lambda: playback.set_rate(0.5))
    clock.at(2.0, lambda: playback.set_rate(0))
    assert play(playback, Frames([0, 1, 2, 3]), clock) == [(0, 0), (0.75, 1), (2, 2), (2, 3)]


@pytest.mark.parametrize("rate", [-1, 100.5, float("nan"), float("inf")])
def test_impossible_rates_are_refused(rate: float) -> None:
    with pytest.raises(ParameterError, match="from 0 to 100"):
        Playback(rate=rate)
    with pytest.raises(ParameterError, match="from 0 to 100"):
        Playback().set_rate(rate)


def test_lost_time_is_not_caught_up_with(clock: FakeClock) -> None:
    passed = []
    for _, item in Playback(clock=clock).run(regular(30)):
        passed.append((clock.time_ns / S, item))
        if item == 5:
            clock.time_ns += 2 * S  # whoever takes it is slow
    assert passed[5:9] == [(0.5, 5), (2.5, 6), (2.6, 7), (2.7, 8)]


def test_a_short_delay_is_caught_up_with(clock: FakeClock) -> None:
    passed = []
    for _, item in Playback(clock=clock).run(regular(10)):
        passed.append((clock.time_ns / S, item))
        if item == 5:
            clock.time_ns += 18 * S // 100
    assert passed[6:] == [(0.68, 6), (0.7, 7), (0.8, 8), (0.9, 9)]


def test_without_hold_it_ends(clock: FakeClock) -> None:
    playback = Playback(clock=clock)
    play(playback, regular(3), clock)
    assert playback.state.ended
    assert not playback.state.playing


def test_held_at_the_end_it_can_be_sought_stepped_and_started_over(clock: FakeClock) -> None:
    playback = Playback(hold=True, clock=clock)
    states = []
    clock.at(1, lambda: states.append(playback.state))
    clock.at(1, lambda: playback.step(-1))
    clock.at(2, lambda: playback.seek(0))
    clock.at(3, playback.play)
    clock.at(4, playback.play)
    clock.at(5, playback.close)
    passed = play(playback, regular(3), clock)
    assert (states[0].ended, states[0].playing, states[0].position_s) == (True, False, 0.2)
    assert [i for t, i in passed if t < 1] == [0, 1, 2]
    assert [i for t, i in passed if 1 <= t < 2] == [1]
    assert [i for t, i in passed if 2 <= t < 3] == [0]
    assert [i for t, i in passed if 3 <= t < 4] == [1, 2]
    assert [i for t, i in passed if t >= 4] == [0, 1, 2]


def test_seeking_at_the_held_end_shows_one_and_does_not_play_on(clock: FakeClock) -> None:
    playback = Playback(hold=True, clock=clock)
    clock.at(1, lambda: playback.seek(0))
    clock.at(2, lambda: playback.seek(0.1))
    clock.at(3, playback.play)
    clock.at(4, playback.close)
    passed = play(playback, regular(4), clock)
    assert [i for t, i in passed if 1 <= t < 2] == [0]
    assert [i for t, i in passed if 2 <= t < 3] == [1]
    assert [i for t, i in passed if t >= 3] == [2, 3]


def test_playing_twice_at_the_held_end_starts_over_from_the_start(clock: FakeClock) -> None:
    playback = Playback(hold=True, clock=clock)
    frames = Spied([0, 0.1, 0.2], playback)
    clock.at(1, lambda: (playback.play(), playback.play()))
    clock.at(2, playback.close)
    assert [number for _, number in playback.run(frames)] == [0, 1, 2, 0, 1, 2]
    assert frames.places[3] == (0, 0)


def test_a_part_repeated_from_the_held_end_plays_on_there(clock: FakeClock) -> None:
    playback = Playback(hold=True, frames=8, clock=clock)
    clock.at(1, lambda: playback.repeat(0.1, 0.2))
    passed = play(playback, Frames([0, 0.1, 0.2, 0.3]), clock)
    assert [number for _, number in passed] == [0, 1, 2, 3, 1, 2, 1, 2]


def test_starting_over_at_the_end_keeps_stamps_increasing(clock: FakeClock) -> None:
    playback = Playback(hold=True, clock=clock)
    clock.at(1, playback.play)
    clock.at(2, playback.close)
    stamps = [stamp for stamp, _ in playback.run(regular(3))]
    assert len(stamps) == 6
    assert stamps == sorted(set(stamps))


def test_loop_switched_on_at_the_held_end_starts_over(clock: FakeClock) -> None:
    playback = Playback(hold=True, frames=5, clock=clock)
    clock.at(1, lambda: playback.set_loop(True))
    assert [i for _, i in play(playback, regular(3), clock)] == [0, 1, 2, 0, 1]


def test_the_real_end_corrects_the_promised_length(clock: FakeClock) -> None:
    playback = Playback(clock=clock)
    play(playback, Frames([0, 0.1, 0.2], promised_s=100), clock)
    assert playback.state.duration_s == pytest.approx(0.3)


def test_a_range_beyond_the_true_end_is_cleared(clock: FakeClock, caplog) -> None:
    playback = Playback(clock=clock, start_s=100, part_s=(100, None), loop=True, frames=5)
    shown = [number for _, number in playback.run(Frames([0, 0.1, 0.2]))]
    assert shown == [2, 0, 1, 2, 0]
    assert playback.state.part_s == playback.first_part_s == (0, None)
    assert "starts after the end" in caplog.text


def test_close_ends_a_wait_within_a_long_gap(clock: FakeClock) -> None:
    playback = Playback(clock=clock)
    clock.at(1, playback.close)
    assert play(playback, Frames([0, 1000]), clock) == [(0, 0)]
    assert clock.time_ns == S
    assert playback.closed


def test_close_from_another_thread_ends_a_real_wait() -> None:
    playback = Playback()
    run = playback.run(Frames([0, 1000]))
    next(run)
    closer = threading.Thread(target=playback.close)
    closer.start()
    assert list(run) == []
    closer.join()


def live(clock: FakeClock, playback: Playback, items: list[int | None]) -> list[int]:
    condition = threading.Condition()

    def pass_time() -> Generator[int | None, None, None]:
        for item in items:
            yield item
            until_ns = clock.time_ns + S // 10
            while clock.time_ns < until_ns:
                clock.wait(condition, until_ns)

    return list(playback.follow(pass_time()))


def test_following_drops_what_comes_while_paused(clock: FakeClock) -> None:
    playback = Playback(clock=clock)
    clock.at(0.15, playback.pause)
    clock.at(0.35, playback.step)
    clock.at(0.55, playback.play)
    assert live(clock, playback, list(range(8))) == [0, 1, 4, 6, 7]


def test_following_ends_by_duration_though_nothing_comes(clock: FakeClock) -> None:
    playback = Playback(duration_s=0.5, clock=clock)
    assert live(clock, playback, [0, 1] + [None] * 20) == [0, 1]
    assert clock.time_ns == S // 2
    assert playback.state.ended


def test_following_ends_by_frames_and_by_close(clock: FakeClock) -> None:
    assert live(clock, Playback(frames=2, clock=clock), list(range(9))) == [0, 1]
    playback = Playback(clock=clock)
    clock.at(clock.time_ns / S + 0.25, playback.close)
    assert live(clock, playback, list(range(9))) == [0, 1, 2]


def test_a_restart_ends_what_is_played_and_goes_on_where_it_was(clock: FakeClock) -> None:
    playback = Playback(clock=clock)
    first = playback.run(Frames([0, 0.1, 0.2]))
    before = [next(first), next(first)]
    playback.restart()
    assert list(first) == []
    assert playback.take_restart()
    after = list(playback.run(Frames([0, 0.1, 0.2])))
    assert not playback.take_restart()
    assert [stamp - WALL for stamp, _ in before] == [0, S // 10]
    assert [stamp - WALL for stamp, _ in after] == [S // 10, S // 5]


@pytest.mark.parametrize("paused", [False, True])
def test_time_does_not_go_back_for_a_restart_between_messages(
    clock: FakeClock, paused: bool
) -> None:
    playback = Playback(clock=clock)
    if paused:
        clock.at(0.15, playback.pause)
    clock.at(0.16, playback.restart)
    list(playback.run(Frames([0, 0.1, 0.2])))
    reached_ns = (15 if paused else 16) * S // 100
    assert playback.time_ns() == reached_ns
    assert playback.stamp_ns() == WALL + reached_ns


def test_steps_back_count_from_where_one_goes(clock: FakeClock) -> None:
    playback = Playback(hold=True, clock=clock)
    shown = []
    run = playback.run(Frames([0, 0.1, 0.2, 0.3]))
    shown.append(next(run)[1])
    playback.seek(0.3)
    playback.step(-1)
    shown.append(next(run)[1])
    playback.step(-1000)
    shown.append(next(run)[1])
    assert shown == [0, 2, 0]


@pytest.mark.parametrize(
    ("requests", "shown"),
    [
        (lambda p: (p.seek(0.5), p.step()), [5, 6]),
        (lambda p: (p.seek(0.5), p.step(), p.step()), [5, 6, 7]),
        (lambda p: (p.seek(0.57), p.step(-1)), [4]),
        (lambda p: (p.seek(0.57), p.step(-1), p.step()), [4, 5]),
        (lambda p: (p.step(3), p.step(-1)), [4, 5]),
        (lambda p: (p.step(), p.step(-2)), [2]),
        (lambda p: (p.seek(0.5), p.set_part(0.4, 0.5)), [5]),
        (lambda p: (p.seek(0.8), p.set_part(0.1, 0.5)), [1]),
        (lambda p: (p.set_part(0.6), p.step()), [6, 7]),
    ],
)
def test_requests_before_a_message_is_shown_act_as_if_it_had_been(clock, requests, shown):
    playback = Playback(start_s=0.3, clock=clock)
    playback.pause()
    clock.at(1, lambda: requests(playback))
    clock.at(2, playback.close)
    assert [i for _, i in play(playback, regular(10), clock)] == [3, *shown]


def held_at_its_end(clock: FakeClock, request: Callable[[Playback], object]) -> list[int]:
    """What passes once a request is made at the end of three messages."""
    playback = Playback(hold=True, clock=clock)
    clock.at(1, lambda: request(playback))
    clock.at(2, playback.close)
    return [i for _, i in play(playback, regular(3), clock)][3:]


def test_a_range_chosen_at_the_held_end_shows_its_start_and_does_not_play_on(clock):
    assert held_at_its_end(clock, lambda playback: playback.set_part(0.0, 0.1)) == [0]


def test_a_second_toggle_at_the_held_end_pauses_again(clock):
    def toggle_twice(playback: Playback) -> None:
        playback.toggle()
        assert (playback.state.playing, playback.state.ended) == (True, False)
        playback.toggle()
        assert not playback.state.playing

    assert held_at_its_end(clock, toggle_twice) == [0]


def test_live_stamps_are_the_times_at_which_messages_pass():
    clock = FakeClock()
    playback = Playback(live_stamps=True, loop=True, frames=60, clock=clock)
    clock.at(0.55, playback.pause)
    clock.at(3.0, playback.play)
    clock.at(4.0, lambda: playback.set_rate(2))
    clock.at(4.5, lambda: playback.seek(0.3))
    clock.at(5.0, lambda: playback.set_rate(0.5))
    stamps = []
    for stamp_ns, _ in playback.run(regular(10)):
        assert stamp_ns == clock.now_ns()
        stamps.append(stamp_ns)
    assert len(stamps) == 60
    assert sorted(set(stamps)) == stamps


def test_the_time_of_the_stamps_is_that_of_the_messages_and_passes_between_them(clock):
    playback = Playback(loop=True, frames=25, clock=clock)
    between = []

    def look():
        between.append((clock.time_ns, playback.stamp_ns()))

    assert playback.stamp_ns() == WALL
    clock.at(0.55, look)
    clock.at(0.56, playback.pause)
    clock.at(2.0, look)
    clock.at(3.0, playback.play)
    clock.at(3.5, lambda: playback.set_rate(2))
    for stamp_ns, _ in playback.run(regular(10)):
        assert playback.stamp_ns() == stamp_ns
    hundredth = S // 100
    assert between == [(55 * hundredth, WALL + 55 * hundredth), (2 * S, WALL + 56 * hundredth)]
    assert playback.stamp_ns() == WALL + 240 * hundredth


def test_a_message_shown_while_paused_has_the_processor_for_itself(monkeypatch) -> None:
    monkeypatch.setattr("ros_visualise.sources.playback._REST_S", 1e6)
    playback, read, shown = Playback(hold=True, start_s=2.0), [], []

    class Noted(Frames):
        def read(self, start_ns: int) -> Generator[tuple[int, int], None, None]:
            for time_ns, number in super().read(start_ns):
                read.append(number)
                yield time_ns, number

    def run() -> None:
        for _, number in playback.run(Noted([0.0, 1.0, 2.0, 3.0], 4.0)):
            shown.append(number)

    playback.pause()
    running = threading.Thread(target=run, daemon=True)
    running.start()
    wait_for(lambda: shown == [2])
    playback.seek(1)
    wait_for(lambda: shown == [2, 1])
    playback.step(1)
    wait_for(lambda: shown == [2, 1, 2])
    playback.close()
    running.join(10)
    assert read == [2, 1, 2]
