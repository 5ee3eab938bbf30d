"""Whether a camera that is turned is noticed, by motions of which all is known."""

import numpy as np
import pytest
from made_worlds import drifting, flight, floor, turn, world

from ros_visualise.estimation.mapping.mapping import map_of
from ros_visualise.estimation.mapping.motions import relative
from ros_visualise.estimation.mapping.mounting import Gyro, camera_mounting, imu_mounting
from ros_visualise.estimation.mapping.smoothing import smooth
from ros_visualise.estimation.mapping.unknowns import MeasurementNoise
from ros_visualise.geometry.se3 import from_parts, inverse, rotation_vectors

NOISE = MeasurementNoise(extra_px=0.1, way_m=0.005, tilt_rad=5e-4, heading_rad=1e-3)
DOWN = np.diag([1.0, -1, -1])
OFF = np.deg2rad([2.0, -1.5, 1.6])  # 3 degrees


@pytest.fixture
def random():
    return np.random.default_rng(2)


def seen_by(random, off, noise=NOISE, sigma_px=0.1):
    """The problem of a robot whose camera is turned by this from what the frames tell."""
    cameras, tags = flight(random, 30, 4.0), floor(random, 6, 4.0)
    told = drifting(random, cameras, noise)
    misled = told @ inverse(from_parts(turn(off), np.zeros(3)))
    return world(random, cameras, tags, sigma_px, odometry=misled)


def test_a_camera_that_is_turned_by_three_degrees_is_noticed(random):
    made = map_of(seen_by(random, OFF))
    mounting = made.mountings[0]
    assert mounting.is_wrong
    assert np.linalg.norm(mounting.turn_deg) == pytest.approx(
        np.rad2deg(np.linalg.norm(OFF)), abs=0.3
    )
    off = mounting.turn_deg - np.rad2deg(OFF)
    assert (np.abs(off) < 4 * mounting.turn_sigma_deg).all()
    assert (mounting.turn_sigma_deg < 0.5).all()


def test_a_camera_that_is_as_the_frames_tell_is_not_blamed(random):
    mounting = map_of(seen_by(random, np.zeros(3))).mountings[0]
    assert not mounting.is_wrong
    assert (np.abs(mounting.turn_deg) < 4 * mounting.turn_sigma_deg).all()


def test_exact_motion_gives_the_exact_turn(random):
    cameras, tags = flight(random, 30, 4.0), floor(random, 6, 4.0)
    misled = cameras @ inverse(from_parts(turn(OFF), np.zeros(3)))
    found = smooth(world(random, cameras, tags, 1e-3, odometry=misled))
    mounting, _ = camera_mounting(found)
    np.testing.assert_allclose(mounting.turn_deg, np.rad2deg(OFF), atol=0.1)


def turning(found, off, bias=0.0, random=None):
    """What a gyroscope measures, of an IMU that the frames take to be elsewhere by a turn."""
    R_imu_camera = np.tile(turn([0.3, 1.0, -0.5]), (len(found.views.t), 1, 1))
    steps = R_imu_camera[0] @ turn(off) @ rotation_vectors(relative(found.views).R)[..., None]
    stamps = found.problem.stamps_ns
    rates = steps[..., 0] / np.diff(stamps)[:, None] * 1e9 + bias
    if random is not None:
        rates = rates + 0.005 * random.standard_normal(rates.shape)
    times = np.sort(np.concatenate([stamps[:-1] + 10**5, stamps[1:] - 10**5]))
    return Gyro(
        np.concatenate([[stamps[0] - 1], times, [stamps[-1] + 1]]),
        np.concatenate([rates[:1], np.repeat(rates, 2, axis=0), rates[-1:]]),
        R_imu_camera,
    )


def test_an_imu_that_is_turned_is_noticed_in_spite_of_its_bias(random):
    found = smooth(seen_by(random, np.zeros(3)), NOISE)
    mounting = imu_mounting(found, turning(found, OFF, np.array([0.02, -0.01, 0.03])))
    assert mounting.is_wrong
    np.testing.assert_allclose(mounting.turn_deg, np.rad2deg(OFF), atol=0.1)
    assert not imu_mounting(found, turning(found, np.zeros(3))).is_wrong


def test_turns_about_one_axis_alone_do_not_tell_how_an_imu_is_turned_about_it(random):
    cameras = np.array(
        [from_parts(turn([0, 0, 0.1 * n]) @ DOWN, [0.1 * n, 0, 3]) for n in range(30)]
    )
    found = smooth(world(random, cameras, floor(random, 6, 3.0), 0.1, odometry=cameras), NOISE)
    mounting = imu_mounting(found, turning(found, np.zeros(3), random=random))
    assert not mounting.is_wrong
    assert "as far as this motion shows" in mounting.text
