import numpy as np

from ros_visualise.geometry.rotations import from_rpy
from ros_visualise.geometry.se3 import (
    apply,
    from_pose,
    interpolate,
    inverse,
    to_pose,
)

RNG = np.random.default_rng(5)
T_A_B = from_pose(RNG.normal(size=(9, 3)), RNG.normal(size=(9, 4)))
T_B_C = from_pose(RNG.normal(size=(9, 3)), RNG.normal(size=(9, 4)))
EYE = np.broadcast_to(np.eye(4), (9, 4, 4))


def test_inverse_takes_back():
    np.testing.assert_allclose(T_A_B @ inverse(T_A_B), EYE, atol=1e-12)
    np.testing.assert_allclose(inverse(T_A_B) @ T_A_B, EYE, atol=1e-12)
    np.testing.assert_allclose(inverse(T_A_B @ T_B_C), inverse(T_B_C) @ inverse(T_A_B), atol=1e-12)


def test_to_parts_and_back():
    np.testing.assert_allclose(from_pose(*to_pose(T_A_B)), T_A_B, atol=1e-12)


def test_points_go_one_transform_after_the_other():
    points = RNG.normal(size=(50, 3))
    after_both = apply(T_A_B[0], apply(T_B_C[0], points))
    np.testing.assert_allclose(after_both, apply(T_A_B[0] @ T_B_C[0], points), atol=1e-12)
    by_hand = [(T_A_B[0] @ [*point, 1])[:3] for point in points]
    np.testing.assert_allclose(apply(T_A_B[0], points), by_hand, atol=1e-12)


def test_many_transforms_at_once():
    points = RNG.normal(size=(9, 5, 3))
    one_by_one = [apply(T, some) for T, some in zip(T_A_B, points, strict=True)]
    np.testing.assert_allclose(apply(T_A_B, points), one_by_one)


def test_points_keep_their_precision_and_may_be_none():
    assert apply(T_A_B[0], np.zeros((4, 3), np.float32)).dtype == np.float32
    assert apply(T_A_B[0], np.zeros((4, 3), int)).dtype == np.float64
    assert apply(T_A_B[0], np.zeros((0, 3), np.float32)).shape == (0, 3)


def test_between_two_poses_it_goes_straight_and_turns_evenly():
    start = from_pose([1, 2, 3], from_rpy([0, 0, 0.2]))
    end = from_pose([3, 0, 3], from_rpy([0, 0, 1.0]))
    quarter = from_pose([1.5, 1.5, 3], from_rpy([0, 0, 0.4]))
    np.testing.assert_allclose(interpolate(start, end, 0.25), quarter, atol=1e-12)
    np.testing.assert_allclose(interpolate(start, end, 0.0), start, atol=1e-12)
    np.testing.assert_allclose(interpolate(start, end, 1.0), end, atol=1e-12)
    both = interpolate(start, end, np.array([0.0, 0.25]))
    np.testing.assert_allclose(both, [start, quarter], atol=1e-12)
