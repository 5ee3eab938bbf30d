"""Stalls, outages, multipath and magnetic disturbance, by what is published."""

import math
from dataclasses import replace
from itertools import groupby, pairwise

import numpy as np
import pytest
from simulated_runs import BLIND_HUSKY, BLIND_QUADROTOR, collect

from ros_visualise.simulation.missions import Mission
from ros_visualise.simulation.sensors.gps import GpsSensor
from ros_visualise.simulation.sensors.magnetometer import Magnetometer
from ros_visualise.simulation.simulator import Simulation

LAPS = Mission("square", size=(8.0, 8.0), height=3.0, speed=0.8, laps=0)
LOST = {"odom_stall_every": 4.0, "odom_stall_for": 1.0}


def moved(odometry):
    return float(sum(math.dist(a.position_xyz, b.position_xyz) for a, b in pairwise(odometry)))


@pytest.mark.parametrize(
    ("robot", "settings"), [("husky", BLIND_HUSKY), ("quadrotor", BLIND_QUADROTOR)]
)
def test_odometry_loses_the_motion_of_its_stalls(robot, settings):
    exact = replace(settings, odom_scale=0.0, odom_noise=0.0)
    runs = [
        collect(Simulation(robot, "plane", 2, LAPS, one), 40.0)
        for one in (exact, replace(exact, **LOST))
    ]
    whole, stalling = (run["odom"][500:] for run in runs)
    still = [not np.any(a.position_xyz - b.position_xyz) for a, b in pairwise(stalling)]
    lengths = [len(list(group)) / 50 for is_still, group in groupby(still) if is_still]
    lengths = [each for each in lengths if each > 0.05]
    assert len(lengths) > 3
    assert np.mean(lengths) == pytest.approx(1.0, abs=0.6)
    assert moved(stalling) / moved(whole) == pytest.approx(1 - np.mean(still), abs=0.08)
    assert all(
        not np.any(m.linear_xyz)
        for m, s in zip(stalling[1:], still, strict=False)
        if s and robot == "quadrotor"
    )


def test_odometry_scale_changes_in_flight():
    exact = replace(BLIND_QUADROTOR, odom_scale=0.0, odom_noise=0.0, odom_yaw_noise=0.0)
    settings = replace(exact, odom_scale_drift=0.05, odom_scale_drift_time=10.0)
    found = collect(Simulation("quadrotor", "plane", 3, LAPS, settings), 60.0)
    ratios = []
    for first in range(500, len(found["odom"]) - 100, 100):
        odom, truth = (found[name][first : first + 100] for name in ("odom", "truth"))
        ratios.append(moved(odom) / moved(truth))
    assert np.std(ratios) > 0.015
    assert np.abs(np.array(ratios) - 1).max() < 0.2


def fixes(seconds=4000.0, **changes):
    settings = replace(BLIND_HUSKY, gps_noise=0.0, gps_drift=0.0, **changes)
    sensor = GpsSensor(settings, 4)
    return [sensor.measure(round(t * 1e9), np.zeros(3)) for t in np.arange(0, seconds, 0.2)]


def test_gps_has_no_fix_during_outages():
    found = fixes(gps_outage_every=60.0, gps_outage_for=15.0)
    lost = [m.status < 0 for m in found]
    assert np.mean(lost) == pytest.approx(0.2, abs=0.07)
    outages = [len(list(group)) / 5 for is_lost, group in groupby(lost) if is_lost]
    assert np.mean(outages) == pytest.approx(15, rel=0.35)
    assert all(math.isnan(m.latitude) == is_lost for m, is_lost in zip(found, lost, strict=False))
    assert not any(m.status < 0 for m in fixes(200.0))


def test_multipath_puts_fixes_aside_for_a_while():
    found = fixes(gps_jump=10.0, gps_jump_every=60.0, gps_jump_for=15.0)
    north = np.array([(m.latitude - 49.0) * 111_206 for m in found])
    values = [value for value, _ in groupby(np.round(north, 3))]
    jumps = [value for value in values if abs(value) > 0.01]
    assert np.mean(np.abs(north) > 0.01) == pytest.approx(0.2, abs=0.07)
    assert len(jumps) > 30  # each with one constant error
    assert np.std(jumps) == pytest.approx(10, rel=0.3)
    assert {tuple(np.diag(m.covariance)) for m in found} == {(0, 0, 0)}  # it does not know


def test_the_magnetometers_covariance_is_that_of_all_its_errors():
    settings = replace(BLIND_QUADROTOR, mag_disturbance=4.0, mag_disturbance_time=10.0)
    exact = replace(settings, mag_disturbance=0.0, mag_bias=0.0, mag_noise=0.0)
    true = Magnetometer(exact, 0).measure(0, np.eye(3)).field_xyz
    found = [Magnetometer(settings, seed).measure(0, np.eye(3)) for seed in range(600)]
    errors = np.array([m.field_xyz - true for m in found])
    assert errors.std(axis=0) * 1e6 == pytest.approx(np.full(3, math.hypot(4.0, 1.0, 0.3)), rel=0.1)
    assert np.mean(errors**2 / np.diag(found[0].covariance)) == pytest.approx(1, abs=0.1)
    one = Magnetometer(replace(settings, mag_noise=0.0), 1)
    series = np.array(
        [one.measure(round(t * 1e9), np.eye(3)).field_xyz for t in np.arange(0, 5000, 2.0)]
    )
    correlation = np.corrcoef(series[:-5, 0], series[5:, 0])[0, 1]
    assert correlation == pytest.approx(math.exp(-1), abs=0.1)
