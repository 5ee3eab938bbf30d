"""Latency, jitter, losses and clocks of simulated sensors, by arrival times and stamps."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_runs import BLIND_HUSKY, BLIND_QUADROTOR

from ros_visualise.data import Transforms
from ros_visualise.simulation.simulator import Simulation

NAMES = {
    "gps": "fix",
    "imu": "imu",
    "odom": "odom",
    "mag": "mag",
    "baro": "pressure",
    "range": "range",
    "flow": "optical_flow",
}


def arrivals(settings, output: str, seconds: float = 20.0, seed: int = 3, robot: str = "quadrotor"):
    """(N, 2) seconds: arrival, stamp."""
    simulation = Simulation(robot, "plane", seed, settings=settings)
    found = []
    for time_ns, name, message in simulation.run():
        if time_ns > seconds * 1e9:
            break
        if name == output:
            message = message.transforms[0] if isinstance(message, Transforms) else message
            found.append((time_ns / 1e9, message.header.stamp_ns / 1e9))
    return np.array(found)


@pytest.mark.parametrize("prefix", NAMES)
def test_each_sensor_has_its_own_latency(prefix):
    settings = replace(
        BLIND_QUADROTOR, range_near=0.0, flow_near=0.0, **{f"{prefix}_latency": 0.12}
    )
    for other, output in NAMES.items():
        found = arrivals(settings, output, 2.0)
        delay = found[:, 0] - found[:, 1]
        assert delay == pytest.approx(
            np.full(len(found), 0.12 if other == prefix else 0), abs=0.006
        )


def test_frames_come_with_their_odometry():
    settings = replace(BLIND_HUSKY, odom_latency=0.2, odom_clock_offset=0.05)
    odom, tf = (arrivals(settings, name, 2.0, robot="husky") for name in ("odom", "tf"))
    np.testing.assert_array_equal(odom, tf)
    assert np.median(odom[:, 0] - odom[:, 1]) == pytest.approx(0.15, abs=0.006)


def test_jitter_is_exponential_and_keeps_the_order():
    settings = replace(BLIND_HUSKY, gps_latency=0.05, gps_jitter=0.04, gps_rate=5.0)
    found = arrivals(settings, "fix", 120.0, robot="husky")
    more = found[:, 0] - found[:, 1] - 0.05
    assert np.all(np.diff(found[:, 0]) >= 0)
    assert np.all(np.diff(found[:, 1]) > 0)
    assert more.min() >= 0
    assert more.mean() == pytest.approx(0.04, rel=0.2)
    assert more.std() == pytest.approx(0.04, rel=0.3)


def test_the_declared_share_of_messages_is_lost():
    whole = arrivals(BLIND_HUSKY, "imu", 20.0, robot="husky")
    lossy = arrivals(replace(BLIND_HUSKY, imu_dropped=0.3), "imu", 20.0, robot="husky")
    assert len(lossy) / len(whole) == pytest.approx(0.7, abs=0.04)
    assert set(lossy[:, 1]) <= set(whole[:, 1])


def test_a_clock_is_off_and_drifts():
    settings = replace(BLIND_HUSKY, gps_clock_offset=0.5, gps_clock_drift=2000.0)
    found = arrivals(settings, "fix", 60.0, robot="husky")
    error = found[:, 1] - found[:, 0]
    slope, start = np.polyfit(found[:, 0], error, 1)
    assert slope == pytest.approx(2e-3, rel=0.01)
    assert start == pytest.approx(0.5, abs=1e-6)


def test_no_stamp_is_before_the_start():
    found = arrivals(replace(BLIND_HUSKY, gps_clock_offset=-0.5), "fix", 3.0, robot="husky")
    assert found[:, 1].min() == 0
    assert (found[-1, 1] - found[-1, 0]) == pytest.approx(-0.5)


def test_a_late_sensor_measures_the_same():
    """Delivery changes when a message comes, not what is in it."""
    late = replace(BLIND_HUSKY, imu_latency=0.3, imu_jitter=0.05)
    runs = [
        [
            m
            for _, name, m in _until(Simulation("husky", "plane", 5, settings=s), 3.0)
            if name == "imu"
        ]
        for s in (BLIND_HUSKY, late)
    ]
    for first, second in zip(*runs, strict=False):
        np.testing.assert_array_equal(first.linear_xyz, second.linear_xyz)
        assert first.header == second.header


def _until(simulation, seconds):
    for output in simulation.run():
        if output[0] > seconds * 1e9:
            return
        yield output
