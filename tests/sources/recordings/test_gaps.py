"""The line of time that is played: as that of the stamps, but without gaps of hours."""

import numpy as np
import pytest

from ros_visualise.sources.recordings.playing import PlayedTime

S = 10**9
HOUR = 3600 * S
START = 1_700_000_000 * S


def of(*stamps_ns):
    return PlayedTime(np.array(stamps_ns, np.int64))


def test_without_a_long_gap_it_is_the_time_since_the_start():
    time = of(START, START + HOUR, START + HOUR + 5)
    assert time.gaps_ns == []
    for place_ns in (0, 7, HOUR, HOUR + 5):
        assert time.place_ns(START + place_ns) == place_ns
        assert time.stamp_ns(place_ns) == START + place_ns
    assert time.place_ns(START - 10) == 0


def test_of_a_long_gap_a_second_is_left():
    time = of(0, START, START + 2 * S, START + 3 * HOUR, START + 3 * HOUR + S)
    assert time.gaps_ns == [START, 3 * HOUR - 2 * S]
    stamps_ns = [0, START, START + 2 * S, START + 3 * HOUR, START + 3 * HOUR + S]
    assert [time.place_ns(one) for one in stamps_ns] == [0, S, 3 * S, 4 * S, 5 * S]


def test_there_and_back_again_is_the_same_and_order_is_kept():
    rng = np.random.default_rng(1)
    steps_ns = rng.integers(0, 3 * S, 200)
    steps_ns[[40, 90, 199]] = 5 * HOUR
    stamps_ns = START + np.cumsum(steps_ns)
    time = of(*stamps_ns)
    places_ns = [time.place_ns(one) for one in stamps_ns.tolist()]
    assert [time.stamp_ns(place) for place in places_ns] == stamps_ns.tolist()
    assert places_ns == sorted(places_ns)
    assert places_ns[-1] < 200 * 3 * S


@pytest.mark.parametrize("place_ns", [0, S // 2, S - 1, S])
def test_a_place_in_the_gap_is_just_after_what_was_before_it(place_ns):
    time = of(0, START)
    stamp_ns = time.stamp_ns(place_ns)
    assert stamp_ns == (START if place_ns == S else place_ns)
    assert time.place_ns(stamp_ns) == place_ns
    assert time.place_ns(START - 1) == S
