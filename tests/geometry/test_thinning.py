"""Thinning: so many points stay, and the bound on how far the shape went astray is true."""

from itertools import pairwise

import numpy as np
import pytest

from ros_visualise.data import Header
from ros_visualise.geometry.thinning import ThinnedPath, simplify


def wander(count, seed=0, dimensions=3):
    """A way that turns slowly, as vehicles go."""
    random = np.random.default_rng(seed)
    headings = np.cumsum(random.normal(0, 0.1, count))
    steps = np.stack([np.cos(headings), np.sin(headings), 0.1 * np.sin(headings / 3)], axis=1)
    return np.cumsum(0.1 * steps, axis=0)[:, :dimensions]


def distances(points, line):
    """(N,): of each point from the nearest piece of a polyline, by the definition."""
    nearest = np.full(len(points), np.inf)
    for a, b in pairwise(line):
        along = b - a
        part = np.clip((points - a) @ along / max(along @ along, 1e-300), 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(points - a - part[:, None] * along, axis=1))
    return nearest


def thinned(points, count):
    return simplify(points, np.zeros(len(points) - 1), count)


@pytest.mark.parametrize("count", [2, 3, 57, 199, 200, 300])
def test_so_many_stay_in_their_order_with_both_ends(count):
    kept, astray_m = thinned(wander(200), count)
    assert len(kept) == min(count, 200)
    assert len(astray_m) == len(kept) - 1
    assert (kept[0], kept[-1]) == (0, 199)
    assert (np.diff(kept) > 0).all()


@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("count", [2, 10, 60])
def test_no_point_is_farther_from_the_line_than_is_said(count, dimensions):
    points = wander(300, dimensions=dimensions)
    kept, astray_m = thinned(points, count)
    for first, last, bound in zip(kept[:-1], kept[1:], astray_m, strict=True):
        away = distances(points[first : last + 1], points[[first, last]])
        assert away.max() == pytest.approx(bound, abs=1e-12)


def test_the_corners_of_a_polygon_are_what_stays():
    corners = np.array([[0.0, 0], [10, 0], [10, 5], [3, 5], [3, 20]])
    parts = np.linspace(0, 1, 40, endpoint=False)[:, None]
    sides = [a + parts * (b - a) for a, b in pairwise(corners)]
    points = np.concatenate([*sides, corners[-1:]])
    kept, astray_m = thinned(points, 5)
    np.testing.assert_array_equal(kept, [0, 40, 80, 120, 160])
    assert astray_m.max() < 1e-12


def test_what_was_astray_before_stays_counted():
    points = wander(100)
    before = np.full(99, 0.25)
    _, astray_m = simplify(points, before, 20)
    _, anew_m = thinned(points, 20)
    assert astray_m.min() >= 0.25
    assert astray_m.max() <= anew_m.max() + 0.25 + 1e-12


def test_points_of_one_place_are_thinned_too():
    kept, astray_m = thinned(np.ones((1000, 3)), 10)
    assert len(kept) == 10
    assert not astray_m.any()


def test_large_coordinates_change_nothing():
    points = wander(500)
    utm = points + np.array([431_000, 5_423_000, 110])
    np.testing.assert_array_equal(thinned(points, 50)[0], thinned(utm, 50)[0])
    np.testing.assert_allclose(thinned(points, 50)[1], thinned(utm, 50)[1], atol=1e-8)


def test_a_track_thinned_again_and_again_keeps_to_its_bound():
    points = wander(5000)
    track = ThinnedPath()
    for number, xyz in enumerate(points):
        track.append(number, np.array([*xyz, 0, 0, 0, 1]), 200)
        assert len(track) <= 200
    path = track.path(Header())
    away = distances(points, path.positions_xyz)
    assert 0 < away.max() <= track.deviation_m
    assert track.deviation_m < 20 * away.max()
    np.testing.assert_array_equal(path.positions_xyz, points[path.stamps_ns])
    np.testing.assert_array_equal(path.stamps_ns[-100:], np.arange(4900, 5000))
    assert (np.diff(path.stamps_ns) > 0).all()


def test_a_straight_track_is_never_astray():
    track = ThinnedPath()
    for number in range(3000):
        track.append(number, np.array([number / 8, 0, 0, 0, 0, 0, 1.0]), 100)
    assert len(track) <= 100
    assert track.deviation_m < 1e-12


def test_what_was_given_outlives_the_thinning():
    track = ThinnedPath()
    points = wander(300)
    given = []
    for number, xyz in enumerate(points):
        track.append(number, np.array([*xyz, 0, 0, 0, 1]), 64)
        path = track.path(Header())
        given.append((path, path.stamps_ns.copy(), path.positions_xyz.copy()))
    for path, stamps_ns, positions_xyz in given:
        np.testing.assert_array_equal(path.stamps_ns, stamps_ns)
        np.testing.assert_array_equal(path.positions_xyz, positions_xyz)


def test_fewer_poses_than_before_may_be_asked_for():
    track = ThinnedPath()
    for number, xyz in enumerate(wander(1000)):
        track.append(number, np.array([*xyz, 0, 0, 0, 1]), 1000 if number < 900 else 50)
    assert len(track) <= 50
