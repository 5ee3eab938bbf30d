import random
from itertools import pairwise

import pytest

from ros_visualise.core.rate import Pacer, Steady

INPUT_HZ = 30
MS = 1_000_000
PERIOD_NS = 1e9 / INPUT_HZ


def passed(stamps_ns, rate_hz):
    pacer = Pacer()
    return [stamp for stamp in stamps_ns if pacer.passes(stamp, rate_hz)]


def mean_hz(stamps_ns):
    return (len(stamps_ns) - 1) / (stamps_ns[-1] - stamps_ns[0]) * 1e9


@pytest.mark.parametrize("jitter_ns", [0, 400_000])
@pytest.mark.parametrize("start_ns", [0, 1_700_000_000_000_000_123])
@pytest.mark.parametrize("rate_hz", [1, 2, 5, 7, 8, 10, 12, 15, 20, 24, 25, 29, 30])
def test_any_requested_rate_is_hit(rate_hz, start_ns, jitter_ns):
    rng = random.Random(1)
    stamps = [
        start_ns + round(i * PERIOD_NS + rng.uniform(0, 1) * jitter_ns)
        for i in range(60 * INPUT_HZ)
    ]
    out = passed(stamps, rate_hz)
    assert mean_hz(out) == pytest.approx(rate_hz, rel=0.01)
    gaps = [after - before for before, after in pairwise(out)]
    assert max(abs(gap - 1e9 / rate_hz) for gap in gaps) <= PERIOD_NS + 2 * jitter_ns


@pytest.mark.parametrize("rate_hz", [30, 31, 60, 240])
def test_every_message_passes_when_more_is_asked_for(rate_hz):
    stamps = [round(i * PERIOD_NS) for i in range(300)]
    assert passed(stamps, rate_hz) == stamps


def test_which_messages_pass_is_a_matter_of_their_stamps_alone():
    rng = random.Random(2)
    stamps = sorted(rng.sample(range(10_000_000_000), 400))
    assert passed(stamps, 12) == passed(stamps, 12)
    shifted = [stamp + 5_000_000_000_000 for stamp in stamps]
    assert [stamp - 5_000_000_000_000 for stamp in passed(shifted, 12)] == passed(stamps, 12)


def test_a_change_of_the_rate_takes_effect_on_the_next_message():
    pacer = Pacer()
    stamps = [round(i * PERIOD_NS) for i in range(90)]
    slow = [stamp for stamp in stamps[:45] if pacer.passes(stamp, 1)]
    fast = [stamp for stamp in stamps[45:] if pacer.passes(stamp, 30)]
    assert slow == [stamps[0], stamps[30]]
    assert fast == stamps[45:]


def test_after_a_gap_nothing_comes_in_a_burst():
    stamps = [round(i * PERIOD_NS) for i in range(31)]
    later = [stamp + 20_000_000_000 for stamp in stamps]
    out = passed(stamps + later, 2)
    assert out == [stamps[0], stamps[15], stamps[30], later[0], later[15], later[30]]


def test_where_stamps_go_back_the_rate_goes_on():
    stamps = [round(i * PERIOD_NS) for i in range(31)]
    assert passed([*stamps, *stamps], 1) == [stamps[0], stamps[30], stamps[30]]


def test_equal_stamps_do_not_stop_it():
    assert passed([5, 5, 5], 10) == [5]


def test_steady_times_leave_out_the_steps_of_a_clock_and_keep_the_jitter():
    steady = Steady()
    monotonic = [33 * number for number in range(9)]
    late = [0, 5, 30, 0, 9, 0, 0, 120, 0]
    set_by = [0, 0, 0, -3_600_000, -3_600_000, -3_599_700, 7_000, 7_000, 7_000]
    times, steps = [], []
    for at, jitter, step in zip(monotonic, late, set_by, strict=True):
        times.append(steady.of((10_000_000 + at - jitter + step) * MS, at * MS) // MS)
        steps.append(steady.step_ns // MS)
    assert times == sorted(times)
    assert [times[0], times[1]] == [10_000_000, 10_000_028]
    assert max(abs(t - 10_000_000 - at) for t, at in zip(times, monotonic, strict=True)) <= 160
    assert [number for number, step in enumerate(steps) if step] == [3, 5, 6]
