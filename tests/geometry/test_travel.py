"""Length, duration and speeds of a way."""

import math

import numpy as np
import pytest

from ros_visualise.geometry.travel import Travel

S = 1_000_000_000


def travel(times_s, positions):
    way = Travel()
    for time_s, position in zip(times_s, positions, strict=True):
        way.add(round(time_s * S), position)
    return way.summary()


def test_a_way_of_known_speeds():
    times = np.arange(0, 30.01, 0.1)
    speeds = np.where((times > 10) & (times <= 15), 3.0, 1.0)[1:]
    x = np.concatenate([[0], np.cumsum(0.1 * speeds)])
    gone = travel(times, [(one, 7.0, 1.0) for one in x])
    assert gone.length_m == pytest.approx(25 + 15)
    assert gone.duration_s == pytest.approx(30)
    assert gone.mean_mps == pytest.approx(40 / 30)
    assert gone.top_mps == pytest.approx(3)


def test_curves_count_in_their_length():
    angles = np.linspace(0, 2 * math.pi, 1001)
    gone = travel(angles, np.stack([5 * np.cos(angles), 5 * np.sin(angles), 0 * angles], axis=1))
    assert gone.length_m == pytest.approx(10 * math.pi, rel=1e-4)
    assert gone.top_mps == pytest.approx(5, rel=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_jitter_of_stamps_makes_no_speed(seed):
    """Stamps up to 9 ms off at 100 Hz: neighbours are 0.2 to 28 ms apart, or swapped."""
    true_s = np.arange(0, 20, 0.01)
    jitter = np.random.default_rng(seed).uniform(-0.009, 0.009, len(true_s))
    seen_s = np.maximum.accumulate(true_s + jitter)
    gone = travel(seen_s, [(2 * t, 0.0, 0.0) for t in true_s])
    assert gone.top_mps == pytest.approx(2, rel=0.02)


def test_two_poses_of_one_stamp_make_no_speed():
    gone = travel([0, 1, 1, 2, 3], [(x, 0.0, 0.0) for x in (0, 1, 2, 2, 3)])
    assert gone.length_m == 3
    assert gone.top_mps == 2


def test_a_gap_is_no_leap():
    gone = travel([0, 1, 101, 102], [(x, 0.0, 0.0) for x in (0, 1, 101, 102)])
    assert gone.top_mps == pytest.approx(1)


def test_a_short_way_has_its_mean_speed():
    gone = travel([0, 0.1, 0.2], [(x, 0.0, 0.0) for x in (0, 0.3, 0.4)])
    assert gone.top_mps == gone.mean_mps == pytest.approx(2)


@pytest.mark.parametrize("times", [[], [5], [5, 5, 5], [0, 0]])
def test_no_time_is_no_speed(times):
    gone = travel(times, [(x, 0.0, 0.0) for x, _ in enumerate(times)])
    assert (gone.duration_s, gone.mean_mps, gone.top_mps) == (0, None, None)


@pytest.mark.parametrize("seed", range(10))
def test_the_top_speed_is_never_below_the_mean(seed):
    random = np.random.default_rng(seed)
    times = np.cumsum(random.exponential(0.3, 200))
    gone = travel(times, random.normal(0, 1, (200, 3)))
    assert gone.top_mps >= gone.mean_mps > 0
