"""The Earth's shape by facts known from elsewhere."""

import numpy as np
import pytest

from ros_visualise.geometry.geodesy import LocalPlane, from_ecef, kitti_mercator, to_ecef

POLAR_RADIUS = 6356752.314245
RNG = np.random.default_rng(2)
EVERYWHERE = RNG.uniform([-90, -180, -5e3], [90, 180, 2.2e7], (500, 3))


@pytest.mark.parametrize(
    ("geodetic", "ecef"),
    [
        ((0, 0, 0), (6378137, 0, 0)),
        ((0, 90, 100), (0, 6378237, 0)),
        ((0, 180, 0), (-6378137, 0, 0)),
        ((90, 0, 0), (0, 0, POLAR_RADIUS)),
        ((-90, 0, -10), (0, 0, 10 - POLAR_RADIUS)),
    ],
)
def test_the_ends_of_the_axes(geodetic, ecef):
    np.testing.assert_allclose(to_ecef(geodetic), ecef, atol=1e-6)


def test_latitude_is_the_angle_of_the_vertical():
    """A step up is a step along the normal, whose slope the latitude is by definition."""
    up = to_ecef([48.5, 9.0, 1.0]) - to_ecef([48.5, 9.0, 0.0])
    np.testing.assert_allclose(up[2], np.sin(np.radians(48.5)), atol=1e-8)
    x, y, z = to_ecef([48.5, 9.0, 0.0])
    assert (x * x + y * y) / 6378137**2 + (z / POLAR_RADIUS) ** 2 == pytest.approx(1, abs=1e-12)


def test_ecef_and_back():
    found = from_ecef(to_ecef(EVERYWHERE))
    np.testing.assert_allclose(found[:, :2], EVERYWHERE[:, :2], atol=1e-11)
    np.testing.assert_allclose(found[:, 2], EVERYWHERE[:, 2], atol=1e-7)


@pytest.mark.parametrize("latitude", [90, -90])
def test_at_the_poles_any_longitude_is_right(latitude):
    found = from_ecef(to_ecef([latitude, 0, 12]))
    assert (found[0], found[2]) == pytest.approx((latitude, 12))


@pytest.mark.parametrize(
    ("latitude", "north_m", "east_m"),
    [(0, 110574, 111320), (45, 111132, 78847), (60, 111412, 55800)],
)
def test_the_lengths_of_a_degree(latitude, north_m, east_m):
    """As tables of them say, to the metre: half a degree each way along the meridian."""
    steps = np.linspace(latitude - 0.5, latitude + 0.5, 101)
    track = to_ecef(np.stack([steps, np.zeros(101), np.zeros(101)], axis=-1))
    assert np.linalg.norm(np.diff(track, axis=0), axis=1).sum() == pytest.approx(north_m, abs=1)
    plane = LocalPlane(latitude, 20.0)
    east = plane.to_enu([latitude, 20.001, 0])[0] * 1000
    assert east == pytest.approx(east_m, abs=1)


def test_the_axes_of_a_plane():
    plane = LocalPlane(49.0, 8.4, 115.0)
    np.testing.assert_allclose(plane.to_enu([49.0, 8.4, 115.0]), 0, atol=1e-8)
    np.testing.assert_allclose(plane.to_enu([49.0, 8.4, 116.5]), [0, 0, 1.5], atol=1e-8)
    north, east = plane.to_enu([[49.00001, 8.4, 115.0], [49.0, 8.40001, 115.0]])
    np.testing.assert_allclose(north, [0, 1.112, 0], atol=2e-3)
    np.testing.assert_allclose(east, [0.7315, 0, 0], atol=2e-3)


def test_a_plane_leaves_the_ground_as_the_earth_curves():
    _, _, up = LocalPlane(0.0, 0.0).to_enu([0.0, 0.1, 0.0])
    distance = 6378137 * np.radians(0.1)
    assert up == pytest.approx(-(distance**2) / (2 * 6378137), rel=1e-4)


def test_a_plane_and_back():
    plane = LocalPlane(-33.9, 151.2, 40.0)
    enu = RNG.uniform(-5000, 5000, (100, 3))
    np.testing.assert_allclose(plane.to_enu(plane.from_enu(enu)), enu, atol=1e-6)


def test_kittis_map_is_true_at_its_latitude():
    scaled = kitti_mercator(
        [[49.0, 8.4, 115.0], [49.0, 8.4001, 117.0], [49.0001, 8.4, 115.0]], 49.0
    )
    circle = 6378137 * np.cos(np.radians(49.0)) * np.radians(1e-4)
    np.testing.assert_allclose(scaled[1] - scaled[0], [circle, 0, 2], atol=1e-6)
    meridian = 6378137 * np.radians(1e-4)
    np.testing.assert_allclose(scaled[2] - scaled[0], [0, meridian, 0], rtol=2e-6, atol=1e-6)


def test_kittis_drive_has_its_length(recordings):
    """Drive 0001 is 107.0 m long, as the data's description says."""
    packets = recordings / "oxts" / "2011_09_26_drive_0001_sync"
    files = sorted(packets.rglob("data/*.txt"))
    geodetic = np.array([np.loadtxt(path)[:3] for path in files])
    assert len(geodetic) == 108
    for metres in (
        kitti_mercator(geodetic, geodetic[0, 0]),
        LocalPlane(*geodetic[0]).to_enu(geodetic),
    ):
        length = np.linalg.norm(np.diff(metres, axis=0), axis=1).sum()
        assert length == pytest.approx(107.0, abs=0.4)
