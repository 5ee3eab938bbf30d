"""Laws of the filter: what a direction tells of a landmark, and joined measurements of an IMU."""

import cv2
import numpy as np
import pytest

from ros_visualise.estimation.camera_view import CameraView, ObservedPose, Sighting
from ros_visualise.estimation.imu import ACCEL, GYRO, ImuInterval, ImuNoise, propagate_by_imu
from ros_visualise.estimation.measuring import Pair, measure
from ros_visualise.estimation.robot import RobotState, core
from ros_visualise.estimation.state import State

DOWN = np.diag([1.0, -1.0, -1.0])


def seen_post(ray):
    """A post ahead and below of a robot, seen in a direction (3,) by a camera that looks down."""
    state = State(RobotState(p=np.array([1.0, 2, 10])), np.eye(core()) * 1e-4)
    state.add("post", np.eye(3), np.array([4.0, 1, 0]), np.eye(6) * 1e-2)
    ray = np.asarray(ray) / np.linalg.norm(ray)
    along = np.multiply.outer(ray, ray)
    covariance = np.eye(6) * 1e6
    covariance[:3, :3] = 1e-6 * (np.eye(3) - along) + 1e6 * along
    sight = Sighting(
        "post", 7, 0.0, None, np.zeros((8, 8)), (ObservedPose(None, ray, covariance, 0.9, False),)
    )
    return CameraView(0, DOWN, np.zeros(3), (sight,), {}, b""), Pair(sight, "post"), state


def test_noise_of_a_direction_is_in_no_jacobian():
    """It would be multiplied with itself, and make every way look longer or shorter."""
    noisy, right = [3.3, 0.8, 10.1], [3.0, 1.0, 10.0]
    (one,), (other,) = (
        measure(view, [pair], s) for view, pair, s in map(seen_post, (noisy, right))
    )
    np.testing.assert_allclose(one.of_landmark, other.of_landmark)
    np.testing.assert_allclose(one.of_shared, other.of_shared)
    np.testing.assert_allclose(other.residual, 0, atol=1e-12)


def test_a_direction_tells_of_a_landmark_what_moving_it_changes():
    view, pair, state = seen_post([3.0, 1.0, 10.0])
    (before,) = measure(view, [pair], state)
    for axis in range(3):
        moved = np.zeros(state.size)
        moved[core() + axis] = 1e-5
        (after,) = measure(view, [pair], state.moved(moved))
        expected = before.of_landmark[0, :, axis] * 1e-5
        assert np.linalg.norm(after.residual) == pytest.approx(np.linalg.norm(expected), rel=1e-3)
    away = np.array([4.0, 1, 0]) - state.robot.p
    np.testing.assert_allclose(before.of_landmark[0, :, :3] @ away, 0, atol=1e-12)


def test_measurements_of_an_imu_joined_are_those_one_by_one():
    random = np.random.default_rng(1)
    robot = RobotState(
        R=cv2.Rodrigues(random.normal(size=3))[0],
        p=random.normal(size=3) * 20,
        v=random.normal(size=3) * 3,
    )
    robot = robot.with_own(GYRO, random.normal(size=3) * 0.01)
    robot = robot.with_own(ACCEL, random.normal(size=3) * 0.1)
    spread = random.normal(size=(core(), core()))
    white = ImuNoise(gyro_walk=0, accel_walk=0, clock_s=0)
    state = State(robot, spread @ spread.T)
    parts = [
        ImuInterval(0.01 + 0.002 * n, *random.normal(size=(2, 3)) * [[1], [3]], np.zeros(3))
        for n in range(5)
    ]
    joined, alone = state.copy(), state.copy()
    propagate_by_imu(joined, parts, white)
    for part in parts:
        propagate_by_imu(alone, [part], white)
    np.testing.assert_allclose(joined.P, alone.P, rtol=1e-9, atol=1e-9)
    for name in ("R", "p", "v"):
        there, expected = getattr(joined.robot, name), getattr(alone.robot, name)
        np.testing.assert_allclose(there, expected, rtol=1e-12)
