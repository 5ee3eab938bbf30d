"""Odometry errs as its covariances say: normalised errors over many seeds along one way."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import seeds
from simulated_runs import collect, twist

from ros_visualise.data import Odometry
from ros_visualise.simulation.attitude import from_rotation_vector, from_yaw, multiply, rows
from ros_visualise.simulation.robots.husky.settings import HuskyParams
from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorParams
from ros_visualise.simulation.sensors.odometry import VisualInertialOdometry, WheelOdometry
from ros_visualise.simulation.simulator import Simulation

SEEDS = seeds.runs(20, of=60)
PERIOD_S = 0.1
HUSKY, QUADROTOR = HuskyParams(), QuadrotorParams()
STEADY_HUSKY = replace(
    HUSKY, odom_scale=0.0, odom_noise=0.0, odom_turn_scale=0.0, odom_turn_noise=0.0
)
STEADY_QUADROTOR = replace(QUADROTOR, odom_scale=0.0, odom_noise=0.0, odom_yaw_noise=0.0)


def drive(params: HuskyParams, seed: int) -> list[Odometry]:
    """Three quarters of a figure of eight with a stop and a turn back on the spot, 37 m."""
    odometry = WheelOdometry(params, seed)
    motions = [(1.0, 0.33)] * 190 + [(0.0, 0.0)] * 5 + [(1.0, -0.33)] * 150
    motions += [(0.0, 1.2)] * 15 + [(-0.5, 0.1)] * 60
    return [
        odometry.advance(round(i * PERIOD_S * 1e9), v * PERIOD_S, turn * PERIOD_S)
        for i, (v, turn) in enumerate(motions, 1)
    ]


def fly(params: QuadrotorParams, seed: int) -> list[Odometry]:
    """Up, along four lanes and some way down, 74 m, leaning and turning at each end."""
    legs = [(0, 0, 1)] * 50 + [(0, 2, 0)] * 70 + [(1, 0, 0)] * 30 + [(0, -2, 0)] * 70
    legs += [(1, 0, 0)] * 30 + [(0, 2, 0)] * 70 + [(1, 0, 0)] * 30 + [(0, -2, 0)] * 70
    legs += [(0, 0, 0)] * 5 + [(0.3, 0.2, -1)] * 20
    odometry = VisualInertialOdometry(params, seed, (3.0, -2.0, 0.1), from_yaw(0.6))
    place, seen = np.array([3.0, -2.0, 0.1]), []
    for i, leg in enumerate(np.array(legs, float)):
        stamp_ns = round(i * PERIOD_S * 1e9)
        place += leg * PERIOD_S
        lean = from_rotation_vector(0.1 * leg[1], 0.1 * leg[0], 0.0)
        attitude = multiply(from_yaw(0.6 + 0.5 * leg[0]), lean)
        linear = np.array(rows(attitude)).T @ leg
        x, y, z = place.tolist()
        seen.append(odometry.advance(stamp_ns, (x, y, z), attitude, linear, np.zeros(3)))
    return seen


@cache
def driven(drift: float = 0.0) -> tuple[list[Odometry], list[list[Odometry]]]:
    """What is true, and what all seeds' odometries say whose scale changes by a fraction."""
    params = replace(HUSKY, odom_scale_drift=drift, odom_scale_drift_time=8.0)
    return drive(STEADY_HUSKY, 0), [drive(params, seed) for seed in range(SEEDS)]


@cache
def flown(drift: float = 0.0) -> tuple[list[Odometry], list[list[Odometry]]]:
    """What is true, and what all seeds' odometries say whose scale changes by a fraction."""
    params = replace(QUADROTOR, odom_scale_drift=drift, odom_scale_drift_time=8.0)
    return fly(STEADY_QUADROTOR, 0), [fly(params, seed) for seed in range(SEEDS)]


def pose_errors(seen: Odometry, true: Odometry) -> np.ndarray:
    """Of x, y, z and yaw."""
    headings = [2 * math.atan2(o.quat_xyzw[2], o.quat_xyzw[3]) for o in (seen, true)]
    yaw = math.remainder(headings[0] - headings[1], 2 * math.pi)
    return np.array([*(seen.position_xyz - true.position_xyz), yaw])


@pytest.mark.parametrize("drift", [0.0, 0.05])
@pytest.mark.parametrize(("travelled", "axes"), [(driven, [0, 1, 5]), (flown, [0, 1, 2, 5])])
def test_poses_err_as_their_covariances_say(travelled, axes, drift):
    truth, runs = travelled(drift)
    columns = [min(axis, 3) for axis in axes]
    for at in len(truth) // 3, 2 * len(truth) // 3, len(truth) - 1:
        errors = np.array([pose_errors(run[at], truth[at])[columns] for run in runs])
        covariances = np.array([run[at].pose_covariance[np.ix_(axes, axes)] for run in runs])
        single = errors**2 / np.diagonal(covariances, axis1=1, axis2=2)
        assert single.mean(axis=0) == pytest.approx(1, abs=within(SEEDS))
        joint = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(covariances), errors)
        assert joint.mean() / len(axes) == pytest.approx(1, abs=within(SEEDS * len(axes)))


@pytest.mark.parametrize("drift", [0.0, 0.05])
def test_wheels_speeds_err_as_their_covariances_say(drift):
    truth, runs = driven(drift)
    for part in slice(0, 190), slice(200, 340), slice(360, 420):
        for axis, speed in (0, lambda o: o.linear_xyz[0]), (5, lambda o: o.angular_xyz[2]):
            squares = [
                (speed(seen) - speed(true)) ** 2 / seen.twist_covariance[axis, axis]
                for run in runs
                for seen, true in zip(run[part], truth[part], strict=True)
            ]
            assert np.mean(squares) == pytest.approx(1, abs=0.1 if not drift else 0.3)


def test_wheels_that_stand_still_are_sure_of_it():
    start, still = WheelOdometry(HUSKY, 1), WheelOdometry(HUSKY, 1)
    start.advance(0, 0.0, 0.0)
    still.advance(0, 0.0, 0.0)
    last = start.advance(20_000_000, 0.02, 0.01)
    still.advance(20_000_000, 0.02, 0.01)
    for i in range(2, 102):
        stood = still.advance(i * 20_000_000, 0.0, 0.0)
    assert stood.pose_covariance == pytest.approx(last.pose_covariance)
    assert math.sqrt(stood.twist_covariance[0, 0]) == pytest.approx(0.001)
    assert math.sqrt(last.twist_covariance[0, 0]) == pytest.approx(
        math.hypot(HUSKY.odom_scale, HUSKY.odom_noise * math.sqrt(50)), rel=0.01
    )


@pytest.mark.parametrize("rate_hz", [20.0, 60.0, 90.0])
def test_wheels_speeds_are_true_at_rates_that_do_not_fit_the_steps(rate_hz):
    still = {"camera": False, "lidar": False, "command_timeout": 60.0}
    settings = replace(STEADY_HUSKY, odom_rate=rate_hz, **still)
    simulation = Simulation("husky", "plane", settings=settings)
    simulation.command(twist(x=0.8, turn=0.4))
    seen = collect(simulation, 3.0)["odom"][-30:]
    assert [o.linear_xyz[0] for o in seen] == pytest.approx([0.8] * 30, rel=0.01)
    assert [o.angular_xyz[2] for o in seen] == pytest.approx([0.4] * 30, rel=0.03)


def test_seen_velocity_errs_as_its_covariance_says():
    truth, runs = flown()
    for at, axis in (100, 1), (130, 0), (410, 2):
        errors = np.array([run[at].linear_xyz[axis] - truth[at].linear_xyz[axis] for run in runs])
        variance = runs[0][at].twist_covariance[axis, axis]
        assert np.mean(errors**2) / variance == pytest.approx(1, abs=within(SEEDS))


def within(count: int) -> float:
    """Three standard deviations of the mean square of as many normal numbers."""
    return 3 * math.sqrt(2 / count)
