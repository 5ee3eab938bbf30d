"""Playing the part of a recording between two marks."""

from itertools import pairwise

import pytest
from test_playback import WALL, FakeClock, Frames, S, play, regular

from ros_visualise.core.errors import ParameterError
from ros_visualise.sources.playback import Playback


@pytest.fixture
def clock():
    return FakeClock()


def test_a_part_has_both_of_its_ends_and_is_held_there(clock):
    playback = Playback(clock=clock)
    playback.set_part(0.2, 0.5)
    assert [frame for _, frame in playback.run(regular(10))] == [2, 3, 4, 5]
    assert playback.state.position_s == 0.5
    assert playback.state.part_s == (0.2, 0.5)


def test_a_loop_goes_on_at_the_stamps_of_the_message_after_the_end(clock):
    playback = Playback(loop=True, frames=9, clock=clock)
    playback.set_part(0.2, 0.5)
    passed = [(clock.time_ns, stamp - WALL, i) for stamp, i in playback.run(regular(10))]
    tenth = S // 10
    assert passed == [(n * tenth, (n + 2) * tenth, 2 + n % 4) for n in range(9)]
    assert playback.laps == 2


def test_irregular_laps_last_as_long_as_to_the_next_message(clock):
    times = [0.0, 0.3, 0.35, 0.9, 1.7]
    playback = Playback(rate=0, loop=True, frames=6, clock=clock)
    playback.set_part(0.3, 1.0)
    stamps = [round(stamp / S, 9) for stamp, _ in playback.run(Frames(times))]
    laps = [0.3, 0.35, 0.9]
    assert stamps == pytest.approx(laps + [time + 1.4 for time in laps])


def test_a_mark_between_messages_begins_with_what_is_seen_there(clock):
    playback = Playback(rate=0, loop=True, frames=5, clock=clock)
    playback.set_part(0.25, 0.45)
    passed = [(stamp, i) for stamp, i in playback.run(regular(10))]
    assert [frame for _, frame in passed] == [2, 3, 4, 2, 3]
    gaps = [after - before for (before, _), (after, _) in pairwise(passed)]
    assert all(gap > 0 for gap in gaps)
    assert gaps[2] == S // 10  # in the place of frame 5
    assert gaps[3] == S // 20


def test_a_part_to_the_end_loops_by_the_length(clock):
    playback = Playback(rate=0, loop=True, frames=7, clock=clock)
    playback.set_part(0.7)
    passed = [(stamp, i) for stamp, i in playback.run(regular(10))]
    assert [frame for _, frame in passed] == [7, 8, 9, 7, 8, 9, 7]
    assert [stamp for stamp, _ in passed] == [(7 + n) * S // 10 for n in range(7)]


def test_who_seeks_behind_the_end_sees_the_rest_and_comes_back(clock):
    playback = Playback(loop=True, frames=8, clock=clock)
    playback.set_part(0.2, 0.4)
    clock.at(0.15, lambda: playback.seek(0.7))
    assert [frame for _, frame in playback.run(regular(10))] == [2, 3, 7, 8, 9, 2, 3, 4]


def test_a_mark_at_the_message_that_is_seen_while_paused(clock):
    playback = Playback(hold=True, clock=clock)
    clock.at(0.25, playback.pause)
    clock.at(1, lambda: playback.set_part(0.0, playback.state.position_s))
    clock.at(2, playback.play)
    clock.at(5, playback.close)
    passed = play(playback, regular(10), clock)
    assert [frame for _, frame in passed] == [0, 1, 2, 0, 1, 2]
    assert [round(time_s, 6) for time_s, _ in passed[3:]] == [2, 2.1, 2.2]


def test_a_part_without_messages_is_not_gone_through_for_ever(clock):
    playback = Playback(loop=True, frames=3, clock=clock)
    playback.set_part(0.1, 0.2)
    passed = play(playback, Frames([0.5, 0.9, 1.0], 1.1), clock)
    assert [frame for _, frame in passed] == [0, 0, 0]


@pytest.mark.parametrize("part", [(1, 1), (2, 1), (-1, 1), (0, 0)])
def test_parts_that_are_none(part):
    playback = Playback()
    with pytest.raises(ParameterError, match="after its start"):
        playback.set_part(*part)
    assert playback.state.part_s == (0, None)
