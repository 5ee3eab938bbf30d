"""Rotations obey the laws of their group, and those of REP 103."""

import numpy as np
import pytest

from ros_visualise.geometry import rotations
from ros_visualise.geometry.rotations import (
    from_matrix,
    from_rpy,
    inverse,
    multiply,
    normalise,
    slerp,
    to_matrix,
    to_rpy,
)

RNG = np.random.default_rng(11)
A, B, C = (normalise(RNG.normal(size=(40, 4))) for _ in range(3))
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
X, Y, Z = np.eye(3)


def about(axis, angle):
    """The quaternion by its definition."""
    return np.array([*(np.sin(angle / 2) * np.asarray(axis)), np.cos(angle / 2)])


def assert_same(a, b, atol=1e-12):
    """As rotations: a quaternion and its negative are the same."""
    np.testing.assert_allclose(np.abs((np.asarray(a) * b).sum(axis=-1)), 1, atol=atol)


def test_the_axioms_of_a_group():
    np.testing.assert_allclose(multiply(A, multiply(B, C)), multiply(multiply(A, B), C), atol=1e-12)
    np.testing.assert_allclose(multiply(A, IDENTITY), A)
    np.testing.assert_allclose(multiply(IDENTITY, A), A)
    np.testing.assert_allclose(
        multiply(A, inverse(A)), np.broadcast_to(IDENTITY, A.shape), atol=1e-12
    )
    np.testing.assert_allclose(inverse(multiply(A, B)), multiply(inverse(B), inverse(A)))


def test_products_are_those_of_matrices():
    np.testing.assert_allclose(to_matrix(multiply(A, B)), to_matrix(A) @ to_matrix(B), atol=1e-12)


def test_matrices_are_rotations():
    R = to_matrix(A)
    np.testing.assert_allclose(
        R @ np.swapaxes(R, 1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(R), 1)


def test_a_quarter_turn_about_each_axis():
    turn = np.pi / 2
    np.testing.assert_allclose(to_matrix(about(Z, turn)) @ X, Y, atol=1e-12)
    np.testing.assert_allclose(to_matrix(about(X, turn)) @ Y, Z, atol=1e-12)
    np.testing.assert_allclose(to_matrix(about(Y, turn)) @ Z, X, atol=1e-12)


@pytest.mark.parametrize("angle", [0, 1e-9, 1e-4, 1, np.pi - 1e-7, np.pi])
@pytest.mark.parametrize("axis", [X, Y, Z, -X, [0.6, 0, 0.8], normalise([1, -2, 3, 0])[:3]])
def test_matrices_and_back_at_every_angle(axis, angle):
    assert_same(from_matrix(to_matrix(about(axis, angle))), about(axis, angle))


def test_lengths_do_not_matter_to_matrices():
    np.testing.assert_allclose(to_matrix(1e-3 * A), to_matrix(A), atol=1e-12)
    np.testing.assert_allclose(to_matrix(-A), to_matrix(A), atol=1e-12)


def test_rpy_turns_about_fixed_axes_in_order():
    roll, pitch, yaw = 0.3, -0.7, 2.0
    by_hand = multiply(about(Z, yaw), multiply(about(Y, pitch), about(X, roll)))
    np.testing.assert_allclose(from_rpy([roll, pitch, yaw]), by_hand)


def test_rpy_and_back():
    rpy = RNG.uniform(
        [-np.pi, -np.pi / 2 + 1e-3, -np.pi], [np.pi, np.pi / 2 - 1e-3, np.pi], (50, 3)
    )
    np.testing.assert_allclose(to_rpy(from_rpy(rpy)), rpy, atol=1e-9)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2])
def test_straight_up_and_down_there_is_no_yaw(pitch):
    quat = from_rpy([0.4, pitch, 1.1])
    found = to_rpy(quat)
    assert found[2] == 0
    np.testing.assert_allclose(found[1], pitch)
    assert_same(from_rpy(found), quat)


@pytest.mark.parametrize("angle", [0, 1e-12, 1e-6, 0.5, 3.0])
@pytest.mark.parametrize("fraction", [0, 0.25, 0.5, 1])
def test_slerp_turns_evenly_about_one_axis(angle, fraction):
    start, axis = B[0], [0.6, 0, 0.8]
    end = multiply(start, about(axis, angle))
    assert_same(slerp(start, end, fraction), multiply(start, about(axis, fraction * angle)))
    assert_same(slerp(start, -end, fraction), multiply(start, about(axis, fraction * angle)))


def test_slerp_of_many_at_once_is_that_of_each():
    fraction = RNG.uniform(size=40)
    one_by_one = [slerp(a, b, f) for a, b, f in zip(A, B, fraction, strict=True)]
    np.testing.assert_allclose(slerp(A, B, fraction), one_by_one)
    assert slerp(A[0], B[0], np.linspace(0, 1, 7)[:, None]).shape == (7, 1, 4)


@pytest.mark.parametrize("name", ["normalise", "to_matrix", "to_rpy"])
@pytest.mark.parametrize("broken", [[0, 0, 0, 0], [0, np.nan, 0, 1], [np.inf, 0, 0, 0]])
def test_what_is_no_rotation_is_refused(name, broken):
    with pytest.raises(ValueError, match="not a rotation"):
        getattr(rotations, name)([IDENTITY, broken])
