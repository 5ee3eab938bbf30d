"""The Allan deviation against closed formulas."""

import re

import numpy as np
import pytest

from ros_visualise.data import Header, Imu, Text
from ros_visualise.lessons.methods.allan import allan_deviation, random_walk
from ros_visualise.lessons.topics import sensors
from ros_visualise.lessons.topics.sensors import Allan


def test_white_noise_falls_with_the_root_of_the_time():
    density, period_s = 3e-3, 0.01
    noise = np.random.default_rng(0).normal(0, density / np.sqrt(period_s), (100_000, 2))
    times_s, deviation = allan_deviation(noise + np.array([5, -7]), period_s)  # a bias is not seen
    is_sure = times_s < 20
    expected = density / np.sqrt(times_s)
    assert deviation[is_sure, 0] == pytest.approx(expected[is_sure], rel=0.12)
    assert random_walk(times_s, deviation[:, 1]) == pytest.approx(density, rel=0.02)
    assert times_s[0] == period_s
    assert times_s[-1] <= 100_000 * period_s / 4


def test_a_ramp_rises_with_the_time():
    slope, period_s = 0.2, 0.1
    rates = slope * period_s * np.arange(1000)[:, None]
    times_s, deviation = allan_deviation(rates, period_s)
    assert deviation[:, 0] == pytest.approx(slope * times_s / np.sqrt(2))


def test_a_sine_has_its_closed_form():
    """Of a sine of frequency f: A sin²(pi f t) / (pi f t)."""
    amplitude, frequency, period_s = 2.0, 0.5, 0.001
    stamps = (np.arange(400_000) + 0.5) * period_s
    times_s, deviation = allan_deviation(
        amplitude * np.sin(2 * np.pi * frequency * stamps)[:, None], period_s
    )
    x = np.pi * frequency * times_s
    is_short = times_s < 20
    expected = amplitude * np.sin(x) ** 2 / x
    assert deviation[is_short, 0] == pytest.approx(expected[is_short], rel=0.02, abs=2e-3)


def test_too_little_has_no_deviation():
    times_s, deviation = allan_deviation(np.zeros((3, 6)), 0.01)
    assert times_s.size == 0
    assert deviation.shape == (0, 6)


def told_s(times_s):
    """The seconds that the lesson says were measured."""
    rng = np.random.default_rng(0)
    shown, lesson = None, Allan(None)
    for time_s in times_s:
        header = Header(round(time_s * 1e9))
        imu = Imu(np.array([0, 0, 0, 1.0]), *rng.normal(0, 0.01, (2, 3)), header=header)
        shown = lesson.step(imu, None) or shown
    [text] = [one.text for one in shown.values() if isinstance(one, Text)]
    return int(re.search(r"measurements\s+in\s+(\d+)\s+s", text)[1])


def test_the_lesson_tells_how_long_was_measured_and_not_the_gaps():
    first, second = np.arange(0, 500, 0.1), np.arange(800, 1300, 0.1)
    assert 940 <= told_s(np.concatenate([first, second])) <= 1000


def test_the_lesson_tells_how_long_the_measurements_last_that_it_keeps(monkeypatch):
    monkeypatch.setattr(sensors, "_MOST", 1000)
    monkeypatch.setattr(sensors, "_DROPPED", 100)
    assert 80 <= told_s(np.arange(0, 300, 0.1)) <= 100
