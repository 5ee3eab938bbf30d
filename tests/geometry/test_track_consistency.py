"""Errors of poses, and how often honest ones lie in the band."""

import numpy as np
import pytest

from ros_visualise.geometry import rotations
from ros_visualise.geometry.trajectory_errors import NEES_BAND, nees, pose_error

LEVEL = np.array([0.0, 0, 0, 1])


def test_positions_and_turns_are_counted_in_the_axes_of_the_frame():
    true = rotations.from_rpy([0, 0, 1.2])
    turned = rotations.multiply(rotations.from_rpy([0.1, 0, 0]), true)  # about the frame's x
    for quat in (turned, -turned):
        error = pose_error(np.array([1.0, 2, 3]), quat, np.array([1.0, 2, 5]), true)
        np.testing.assert_allclose(error, [0, 0, -2, 0.1, 0, 0], atol=1e-12)


def test_a_turn_of_nothing_and_a_half_turn():
    np.testing.assert_array_equal(pose_error(np.ones(3), LEVEL, np.ones(3), LEVEL), np.zeros(6))
    about_z = pose_error(np.ones(3), np.array([0.0, 0, 1, 0]), np.ones(3), LEVEL)
    np.testing.assert_allclose(np.abs(about_z), [0, 0, 0, 0, 0, np.pi])


def test_it_is_measured_by_the_covariance():
    error = np.array([0.3, 0, 0, 0, 0, 0.02])
    covariance = np.diag([0.01, 1, 1, 1, 1, 0.0001])
    assert nees(error, covariance) == pytest.approx(9 + 4)
    assert nees(error, np.zeros((6, 6))) is None
    assert nees(error, -covariance) is None
    assert nees(np.full(6, np.nan), covariance) is None


def test_of_honest_poses_95_of_100_lie_in_the_band():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(6, 6)) * 0.02
    found = [nees(root @ rng.normal(size=6), root @ root.T) for _ in range(20_000)]
    low, high = NEES_BAND
    assert np.mean(found) == pytest.approx(6, abs=0.1)
    assert np.mean([low < one < high for one in found]) == pytest.approx(0.95, abs=0.006)
