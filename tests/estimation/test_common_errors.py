"""What the landmarks of a map are off together, and what each is off beside that."""

import numpy as np
import pytest

from ros_visualise.estimation.localization.common_error import beside, split

COMMON = np.diag([0.3, 0.2, 0.1, 0.02, 0.01, 0.03]) ** 2


def joint_of(common, own):
    """(M, 6, M, 6) of landmarks that share one error, and have another each."""
    count = len(own)
    joint = np.tile(common[None, :, None, :], (count, 1, count, 1))
    joint[np.arange(count), :, np.arange(count)] += own
    return joint


def test_it_is_told_apart():
    own = np.array([np.eye(6) * 1e-6 * (1 + number) for number in range(40)])
    common, rest = split(joint_of(COMMON, own))
    np.testing.assert_allclose(common, COMMON, atol=1e-6)
    np.testing.assert_allclose(rest, own, rtol=0.1, atol=1e-9)


def test_landmarks_are_apart_by_no_less_than_they_were():
    """Also where the error grows along the way, as that of an odometry does."""
    steps = np.minimum.outer(np.arange(1, 13), np.arange(1, 13))
    joint = np.einsum("ij,ab->iajb", steps, np.eye(6)) * 1e-4
    _, own = split(joint)
    sums = [own[i] + own[i + 1] for i in range(11)]
    apart = [joint[i, :, i] + joint[i + 1, :, i + 1] - 2 * joint[i, :, i + 1] for i in range(11)]
    assert all(np.linalg.eigvalsh(one - two)[0] > 0 for one, two in zip(sums, apart, strict=True))


@pytest.mark.parametrize("count", [0, 1])
def test_one_landmark_has_its_error_for_itself(count):
    common, own = split(joint_of(COMMON, np.zeros((count, 6, 6))))
    assert not common.any()
    assert own.shape == (count, 6, 6)


def test_what_is_left_beside_it_is_never_negative():
    np.testing.assert_allclose(beside(COMMON + np.eye(6), COMMON), np.eye(6), atol=1e-12)
    assert np.linalg.eigvalsh(beside(np.eye(6) * 1e-3, COMMON))[0] > -1e-15
