"""The laws of twists: exp and log, the adjoint, and errors about a point."""

import numpy as np
import pytest

from ros_visualise.geometry import se3

RNG = np.random.default_rng(8)


def matrix(twist):
    """exp as the sum of powers of the twist's 4x4 matrix."""
    power, total = np.eye(4), np.eye(4)
    step = np.zeros((4, 4))
    step[:3, :3], step[:3, 3] = se3.cross(twist[3:]), twist[:3]
    for n in range(1, 40):
        power = power @ step / n
        total = total + power
    return total


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 1e-3, 0.5, 3.0])
def test_exp_is_the_matrix_exponential_and_log_takes_it_back(angle):
    axis = RNG.normal(size=3)
    twist = np.concatenate([RNG.normal(size=3), angle * axis / np.linalg.norm(axis)])
    R, p = se3.exp(twist)
    np.testing.assert_allclose(se3.from_parts(R, p), matrix(twist), atol=1e-12)
    np.testing.assert_allclose(se3.log(R, p), twist, atol=1e-8)


def test_adjoint_takes_a_twist_through_a_frame():
    R, p = se3.exp(RNG.normal(size=6))
    twist = RNG.normal(size=6)
    T = se3.from_parts(R, p)
    ahead = se3.from_parts(*se3.exp(se3.adjoint(R, p) @ twist))
    np.testing.assert_allclose(
        ahead, T @ se3.from_parts(*se3.exp(twist)) @ se3.inverse(T), atol=1e-12
    )


def test_moved_is_exp_before_the_pose():
    twists = RNG.normal(size=(5, 6))
    R, p = se3.exp(RNG.normal(size=(5, 6)))
    found = se3.from_parts(*se3.moved(twists, R, p))
    expected = se3.from_parts(*se3.exp(twists)) @ se3.from_parts(R, p)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_errors_about_the_origin_and_about_a_point():
    p, error = RNG.normal(size=3), 1e-7 * RNG.normal(size=6)
    turned, shifted = se3.moved(se3.about_origin(p) @ error, np.eye(3), p)
    np.testing.assert_allclose(shifted - p, error[:3], atol=1e-13)
    np.testing.assert_allclose(se3.rotation_vector(turned), error[3:], atol=1e-13)
    np.testing.assert_allclose(se3.about_itself(p) @ se3.about_origin(p), np.eye(6), atol=1e-12)


def test_many_rotation_vectors_are_those_of_each():
    R, _ = se3.exp(RNG.normal(size=(20, 6)))
    R[0] = np.eye(3)
    each = [se3.rotation_vector(one) for one in R]
    np.testing.assert_allclose(se3.rotation_vectors(R), each, atol=1e-12)
