"""Presentation times keep the gaps between stamps and always increase."""

from itertools import pairwise

import pytest

from ros_visualise.sinks.mp4 import TICKS_PER_SECOND, VideoTimeline

SECOND_NS = 1_000_000_000
HOUR_NS = 3600 * SECOND_NS


def place(*stamps_ns: int) -> list[int]:
    timeline = VideoTimeline()
    return [timeline.place(stamp) for stamp in stamps_ns]


def test_uneven_gaps_are_kept() -> None:
    assert place(5 * SECOND_NS, 6 * SECOND_NS, 6_500_000_000) == [0, 90_000, 135_000]


def test_ntsc_times_fall_on_whole_ticks_without_drift() -> None:
    stamps = [1_700_000_000 * SECOND_NS + i * 1001 * SECOND_NS // 30_000 for i in range(10_000)]
    assert place(*stamps) == [i * 3003 for i in range(10_000)]


@pytest.mark.parametrize("start", [0, 7 * SECOND_NS])
def test_equal_and_close_stamps_still_increase(start: int) -> None:
    ticks = place(start, start, start + 1, start + 2)
    assert all(a < b for a, b in pairwise(ticks))


@pytest.mark.parametrize("jump_ns", [-4 * SECOND_NS, -(10**18), HOUR_NS + 2 * SECOND_NS, 10**18])
def test_a_jump_takes_the_usual_time_and_then_goes_on(jump_ns: int) -> None:
    after = 5 * SECOND_NS + jump_ns
    ticks = place(4 * SECOND_NS, 5 * SECOND_NS, after, after + SECOND_NS // 2)
    assert ticks == [0, 90_000, 180_000, 225_000]


def test_a_long_gap_is_kept() -> None:
    assert place(0, HOUR_NS - 1) == [0, 3600 * TICKS_PER_SECOND]


def test_the_last_gap_is_told() -> None:
    timeline = VideoTimeline()
    assert timeline.gap == 3000
    timeline.place(0)
    timeline.place(SECOND_NS // 10)
    assert timeline.gap == 9000
