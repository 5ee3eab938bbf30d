"""Wind: gusts as the Dryden model has them, and what they do to the quadrotor."""

import math
from dataclasses import replace

import numpy as np
import pytest
from simulated_runs import BLIND_QUADROTOR, collect

from ros_visualise.simulation.robots.quadrotor.wind import Gusts, dryden, mean_wind
from ros_visualise.simulation.simulator import Simulation

FOOT = 0.3048


@pytest.fixture(scope="module")
def gusts():
    """Forty minutes of gusts at 6 m in a wind of 6 m/s, sampled every 20 ms."""
    deviations, lengths = dryden(6.0, 6.0)
    noise = Gusts(np.random.default_rng(5))
    return np.array([noise.step(0.02, deviations, lengths, 6.0) for _ in range(120_000)])


def test_strength_and_length_of_gusts_are_those_of_the_standard():
    deviations, lengths = dryden(10.0, 100 * FOOT)
    assert deviations == pytest.approx([1.0 / 0.2593**0.4, 1.0 / 0.2593**0.4, 1.0], rel=1e-4)
    assert lengths / FOOT == pytest.approx([100 / 0.2593**1.2] * 2 + [100], rel=1e-4)
    assert dryden(10.0, 0.2)[1] == pytest.approx(dryden(10.0, 10 * FOOT)[1])


def test_the_mean_wind_is_as_given_6_m_above_the_ground_and_calm_on_it():
    assert mean_wind(6.0, 20 * FOOT) == pytest.approx(6.0)
    assert mean_wind(6.0, 3 * FOOT) == pytest.approx(6 * math.log(3 / 0.15) / math.log(20 / 0.15))
    assert 0 < mean_wind(6.0, 0.0) < 1


def test_gusts_vary_as_much_as_they_should(gusts):
    deviations, _ = dryden(6.0, 6.0)
    assert gusts.std(axis=0) == pytest.approx(deviations, rel=0.1)
    assert abs(np.corrcoef(gusts.T) - np.eye(3)).max() < 0.1


@pytest.mark.parametrize("axis", range(3))
def test_gusts_have_the_spectra_of_dryden(gusts, axis):
    """Averaged periodograms, against the one-sided spectra of MIL-F-8785C in rad/s."""
    deviations, lengths = dryden(6.0, 6.0)
    sigma, time = deviations[axis], lengths[axis] / 6.0
    pieces = gusts[:, axis].reshape(-1, 5000) * np.hanning(5000)
    power = (abs(np.fft.rfft(pieces, axis=1)) ** 2).mean(axis=0)
    power *= 2 * 0.02 / (2 * math.pi * (np.hanning(5000) ** 2).sum())
    omega = 2 * math.pi * np.fft.rfftfreq(5000, 0.02)
    square = (time * omega) ** 2
    shape = 2 / (1 + square) if axis == 0 else (1 + 3 * square) / (1 + square) ** 2
    expected = sigma**2 * time / math.pi * shape
    for low, high in ((0.2, 1), (1, 3), (3, 10)):
        band = (omega > low) & (omega < high)
        assert power[band].mean() == pytest.approx(expected[band].mean(), rel=0.2)


def hover(seed: int, **settings):
    """Positions of a quadrotor that takes off and hovers."""
    simulation = Simulation("quadrotor", "plane", seed, None, replace(BLIND_QUADROTOR, **settings))
    simulation.act("take_off")
    found = collect(simulation, 8)
    return simulation, found["truth"]


def test_the_same_seed_has_the_same_gusts_and_another_has_others():
    first, again, other = (hover(seed, wind=6.0)[1][-1].position_xyz for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_steady_wind_tilts_the_quadrotor_into_it_but_does_not_carry_it_away():
    simulation, truth = hover(0, wind=6.0, gusts=0.0, wind_direction=90.0)
    assert np.linalg.norm(truth[-1].position_xyz[:2]) < 0.1
    tilt = simulation._robot.body.axes[:, 2]
    drag = 0.45 * mean_wind(6.0, 2.0) / 1.5 / 9.81  # of its rotors, beside its weight
    assert tilt[0] == pytest.approx(0, abs=0.01)
    assert -1.4 * drag < tilt[1] < -0.9 * drag
