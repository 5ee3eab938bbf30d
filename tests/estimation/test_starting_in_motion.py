"""Odometry with an IMU that begins in motion: a velocity that is known, or none."""

from dataclasses import replace

import numpy as np
import pytest
from inertial_flight import FOCAL, T_BASE_CAMERA, InertialFlight

from ros_visualise.estimation.inertial import moving
from ros_visualise.estimation.inertial.filter import InertialFilter, InertialSettings
from ros_visualise.estimation.inertial.moving import start_in_motion
from ros_visualise.estimation.inertial.sliding import MOTION
from ros_visualise.estimation.inertial.starting import SeenCorners
from ros_visualise.estimation.inertial.tracks import CornerNoise
from ros_visualise.estimation.settings import CameraErrors

SETTINGS = InertialSettings(CornerNoise(0.3 / FOCAL, 1e-5), camera=CameraErrors(1e-3, 1e-3, 0.0))
STEP_NS = 100_000_000


class Straight(InertialFlight):
    """A flight at constant velocity, whose scale no accelerometer shows."""

    def _sums(self, t):
        return np.array([1.5 * t, 0.3 * t, 0, 0, 0, 0])


class Pushed(InertialFlight):
    """A flight at nearly constant velocity."""

    def _sums(self, t):
        return np.array([1.5 * t + 0.4 * np.sin(2 * t), 0.3 * t, 0, 0, 0, 0])


def seen(flight, first, count=20):
    """Views from an image on, 10 a second, with the IMU measured up to the last."""
    flight.measure((first + count) / 10)
    views = []
    for n in range(first, first + count):
        ids, rays = flight.see(n / 10)
        rolling = np.zeros((len(ids), 3))
        views.append(SeenCorners(n * STEP_NS, ids, rays, T_BASE_CAMERA, np.zeros(3), rolling))
    return views


def velocity(flight, t):
    """(3,) in the robot's axes."""
    moved = flight.pose(t + 0.01)[:3, 3] - flight.pose(t - 0.01)[:3, 3]
    return flight.pose(t)[:3, :3].T @ moved / 0.02


@pytest.mark.parametrize(("seed", "first"), [(1, 30), (3, 60)])
def test_velocity_and_gravity_are_found_in_flight(seed, first):
    flight = InertialFlight(seed)
    views = seen(flight, first)
    begun = start_in_motion(flight.imu, views, SETTINGS)
    true, T = velocity(flight, first / 10), flight.pose(first / 10)
    assert begun.stamp_ns == first * STEP_NS
    error = begun.robot.R.T @ begun.robot.v - true
    assert np.linalg.norm(error) < 0.1 * np.linalg.norm(true) + 0.05
    assert np.linalg.norm(np.cross(begun.robot.R[2], T[2, :3])) < 0.03
    sigmas = np.sqrt(np.diag(begun.covariance)[MOTION])
    assert (np.abs(error) < sigmas / 2).all()
    own = InertialFilter(SETTINGS, flight.imu, *begun)
    assert all(own.see(*view) for view in views)
    after = own.state.robot.R.T @ own.state.robot.v - velocity(flight, (first + 19) / 10)
    assert np.linalg.norm(after) < 0.1
    assert np.sqrt(own.state.P[MOTION, MOTION].trace()) < 0.2


def test_the_velocity_errs_as_much_as_is_said_on_a_gimbal_that_jumps(monkeypatch):
    solved, found = moving._solved, []
    monkeypatch.setattr(moving, "_solved", lambda *a: found.append(solved(*a)) or found[-1])
    flight = InertialFlight(3, jump_rad=0.005)
    settings = replace(SETTINGS, camera=CameraErrors(1e-3, 0.025, 5.0))
    assert moving.start_in_motion(flight.imu, seen(flight, 30), settings)
    error = found[0].x[:3] - velocity(flight, 3.0)
    assert np.linalg.norm(error) < 0.25  # 0.8 with one attitude for all images
    assert error @ np.linalg.solve(found[0].P[:3, :3], error) < 8  # 95%


def test_a_constant_velocity_does_not_show_the_scale():
    flight = Straight(2)
    assert start_in_motion(flight.imu, seen(flight, 30), SETTINGS) is None


@pytest.mark.parametrize("seed", [4, 5])
def test_a_weak_push_shows_no_scale_in_coarse_images_even_with_an_exact_calibration(seed):
    flight = Pushed(seed, noise_px=3)
    assert start_in_motion(flight.imu, seen(flight, 30), SETTINGS) is None


def test_few_corners_or_a_gap_of_the_imu_begin_nothing():
    flight = InertialFlight(1, corners=4)
    assert start_in_motion(flight.imu, seen(flight, 30), SETTINGS) is None
    flight = InertialFlight(1)
    views = seen(flight, 30)
    flight.imu.forget(40 * STEP_NS)
    assert start_in_motion(flight.imu, views, SETTINGS) is None
