"""Which planes show a movement."""

import numpy as np
import pytest

from ros_visualise.plotting.trajectory_plot import ALL, other_axis, planes_of


def moved(x, y, z):
    turn = np.linspace(0, 2 * np.pi, 50)
    return np.stack([x * np.cos(turn), y * np.sin(turn), z * np.sin(2 * turn)], axis=1) / 2


@pytest.mark.parametrize(
    ("extent", "planes"),
    [
        ((20, 10, 3), ((0, 1),)),
        ((500, 10, 450), ((0, 2),)),  # a camera's optical frame on a road
        ((1, 30, 20), ((1, 2),)),
        ((0.4, 0.7, 0.5), ALL),
        ((10, 0.01, 0.02), ((0, 1),)),  # along a line, with jitter
        ((0.02, 0, 10), ((0, 2),)),  # straight up
        ((0, 0, 0), ((0, 1),)),
    ],
)
def test_the_plane_is_that_of_the_two_largest_extents(extent, planes):
    assert planes_of([moved(*extent)]) == planes


def test_all_paths_count_and_wishes_are_granted():
    above = moved(9, 2, 0) + np.array([0, 0, 50])
    assert planes_of([moved(9, 2, 0), above]) == ((0, 2),)
    assert planes_of([moved(9, 9, 0)], "yz") == ((1, 2),)
    assert planes_of([moved(9, 9, 0)], "all") == ALL
    assert [other_axis(plane) for plane in ALL] == [2, 1, 0]
