"""Similarities hold the laws of a group, and their twists those of its algebra."""

import numpy as np
import pytest

from ros_visualise.geometry import similarity


def matrix(a):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = a.s * a.R, a.t
    return T


def generator(twist):
    x, y, z = twist[3:6]
    T = np.zeros((4, 4))
    T[:3, :3] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) + twist[6] * np.eye(3)
    T[:3, 3] = twist[:3]
    return T


def series(A):
    """The exponential of a matrix, by its power series of a 1024th."""
    small = np.eye(4) + (A := A / 1024) + A @ A / 2 + A @ A @ A / 6
    return np.linalg.matrix_power(small, 1024)


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e-8])
@pytest.mark.parametrize("without", [slice(0), slice(6, 7), slice(3, 6), slice(3, 7)])
def test_twists(size, without):
    random = np.random.default_rng(1)
    for _ in range(5):
        twist = size * random.normal(0, 0.7, 7)
        twist[without] = 0
        found = similarity.exp(twist)
        assert matrix(found) == pytest.approx(series(generator(twist)), abs=1e-7)
        assert similarity.log(found) == pytest.approx(twist, abs=1e-8)
        other = similarity.exp(random.normal(0, 0.7, 7))
        moved = similarity.product(similarity.product(other, found), similarity.inverse(other))
        by_twist = similarity.exp(similarity.adjoint(other) @ twist)
        assert matrix(moved) == pytest.approx(matrix(by_twist), abs=1e-8)


def test_products_are_those_of_matrices():
    a, b = (similarity.exp(np.random.default_rng(n).normal(0, 1, 7)) for n in range(2))
    assert matrix(similarity.product(a, b)) == pytest.approx(matrix(a) @ matrix(b))
    assert matrix(similarity.inverse(a)) == pytest.approx(np.linalg.inv(matrix(a)))
