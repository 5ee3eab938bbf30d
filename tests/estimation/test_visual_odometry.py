"""Visual odometry against the known motion of a drawn flight, and images that show no motion."""

import numpy as np
import pytest
from visual_flight import HEIGHT, Flight

from ros_visualise.estimation.visual.bundle import BundleScene, linearize
from ros_visualise.estimation.visual.equations import Sightings
from ros_visualise.estimation.visual.odometry import VisualOdometry, VisualSettings
from ros_visualise.geometry import se3
from ros_visualise.geometry.trajectory_errors import nees
from ros_visualise.vision.tracking import CornerTracker

PERIOD_NS = 100_000_000


def flown(images, settings=None, positions=None):
    """The odometry after these images, and the poses it gave at once."""
    flight = Flight()
    odometry = VisualOdometry([flight.info], None, settings or VisualSettings(corners=120))
    found = []
    for number, image in enumerate(images):
        if positions is not None:
            odometry.measured(number * PERIOD_NS, positions[number], 0.01)
        found.append(odometry.step(number * PERIOD_NS, image))
    return odometry, found


def errors(pose):
    """The errors of a pose, and their covariance, in the order of ROS's messages."""
    R, p = Flight().motion(0, pose.stamp_ns // PERIOD_NS)
    change = se3.about_itself(pose.p)
    error = np.concatenate([pose.p - p, se3.rotation_vector(pose.R @ R.T)])
    return error, change @ pose.covariance @ change.T


@pytest.fixture(scope="module")
def images():
    return [Flight().image(number) for number in range(18)]


def test_the_height_over_the_ground_gives_metres(images):
    odometry, found = flown(images, VisualSettings(corners=120, height=HEIGHT))
    last = odometry.finish()[-1]
    error, covariance = errors(last)
    way = np.linalg.norm(Flight().motion(0, 17)[1])
    assert found[-1].in_metres
    assert last.stamp_ns == 17 * PERIOD_NS
    assert np.linalg.norm(error[:3]) < 0.03 * way
    assert np.linalg.norm(error[3:]) < np.deg2rad(0.5)
    assert nees(error, covariance) < 33  # 6 numbers, 99.999% of consistent poses


def test_positions_give_metres_in_any_frame(images):
    flight = Flight()
    positions = [flight.p(number)[[1, 2, 0]] + [100, 5, -7] for number in range(18)]
    settings = VisualSettings(corners=120, has_positions=True)
    odometry, _ = flown(images, settings, positions)
    last = odometry.finish()[-1]
    error, _ = errors(last)
    assert last.in_metres
    assert np.linalg.norm(error[:3]) < 0.05 * np.linalg.norm(flight.motion(0, 17)[1])


def test_without_a_scale_lengths_are_no_metres_and_losses_are_reported(images):
    dark, frozen = np.zeros_like(images[0]), [images[9]] * 2
    shown = [*images[:9], dark, *images[9:10], *frozen, *images[10:14], *[dark] * 15]
    odometry, found = flown(shown)
    first = next(number for number, one in enumerate(found) if one is not None)
    assert not any(one.in_metres for one in found[first:])
    assert [one.is_lost for one in found[8:14]] == [False, True, False, False, True, False]
    sigmas = [float(np.trace(one.covariance)) if one else 0.0 for one in found]
    assert sigmas[9] > sigmas[8]
    assert found[13].stamp_ns == 13 * PERIOD_NS
    assert odometry.reason == "too dark"
    assert sigmas[-1] > sigmas[-5] > sigmas[-10]
    assert odometry.counts["losses"] == 1


def test_a_camera_at_rest_shows_no_motion(images):
    noise = np.random.default_rng(0)
    still = [
        np.clip(images[0] + noise.normal(0, 2, images[0].shape), 0, 255).astype(np.uint8)
        for _ in range(5)
    ]
    odometry, found = flown(still)
    assert found == [None] * 5
    assert odometry.reason == "waiting for motion"


class Rising(Flight):
    """A camera that looks straight down and rises by a twentieth of its height an image."""

    def p(self, n):
        return np.array([4.0, 0.0, HEIGHT * 1.05**n])

    def R(self, n):  # noqa: N802
        return np.array([[0.0, -1, 0], [-1, 0, 0], [0, 0, -1]])


def test_rising_from_a_plane_shows_no_motion_yet():
    odometry, found = flown(Rising().image(number) for number in range(9))
    assert found == [None] * 9
    assert odometry.reason == "waiting for sideways motion"


def test_finds_its_way_again_after_a_loss(images):
    dark = np.zeros_like(images[0])
    odometry, found = flown([*images, *[dark] * 12, *images])
    assert odometry.counts["losses"] == 1
    assert [one.is_lost for one in found[16:32]] == [False] * 2 + [True] * 14
    assert not found[-1].is_lost
    assert np.trace(found[-1].covariance) > np.trace(found[17].covariance)


def test_corners_are_followed_to_a_tenth_of_a_pixel(images):
    tracker = CornerTracker(100)
    tracker.follow(np.ascontiguousarray(images[0][10:, 10:]))
    before = tracker.refill()
    after = tracker.follow(np.ascontiguousarray(images[0][7:-3, 6:-4]))
    assert len(after.ids) > 0.8 * len(before.ids)
    off = np.abs(after.pixels_uv - after.before_uv - [4, 3]).max(axis=1)
    assert np.quantile(off, 0.9) < 0.1  # those at the border lack a part of their patch


def test_derivatives_of_sightings_are_those_of_differences():
    noise = np.random.default_rng(0)
    R, p = se3.exp(noise.normal(size=(3, 6)) * 0.1)
    points = np.column_stack([noise.uniform(-0.5, 0.5, (6, 2)), noise.uniform(0.1, 0.5, 6)])
    cameras = np.stack([np.eye(4), se3.from_parts(np.eye(3), [0.5, 0, 0])])
    scene = BundleScene(R, p, noise.integers(0, 2, 6), points, cameras)
    rays = np.zeros((6, 6, 2))  # views and cameras, points
    rays[5, 2], rays[2, 4] = np.nan, np.nan

    def expected(x):
        moved = scene.moved(x[:18].reshape(3, 6), x[18:].reshape(6, 3))
        return -linearize(moved, rays).residuals.ravel()

    step, x = 1e-6 * np.eye(36), noise.normal(size=18)
    J = np.column_stack([(expected(one) - expected(-one)) / 2e-6 for one in step])
    lengths = np.linalg.norm(expected(np.zeros(36)).reshape(-1, 2), axis=1)
    weights = np.minimum(1, 2 / np.maximum(lengths, 1e-9)).repeat(2)
    H, g = J.T @ (J * weights[:, None]), -J.T @ (weights * expected(np.zeros(36)))
    found = Sightings(rays, scene.host, 2).normal(scene, 1.0)
    assert np.allclose(found.H, H[:18, :18], atol=1e-4)
    assert np.allclose(found.g, g[:18], atol=1e-4)
    alone = found.reduced(0.0)
    gain = np.linalg.solve(H[18:, 18:], H[18:, :18]).T
    assert np.allclose(alone.H, H[:18, :18] - gain @ H[18:, :18], atol=1e-4)
    assert np.allclose(alone.g, g[:18] - gain @ g[18:], atol=1e-4)
    points = np.linalg.solve(H[18:, 18:], g[18:] - H[18:, :18] @ x)
    assert np.allclose(alone.points_of(x).ravel(), points, atol=1e-4)


def test_fast_images_of_flat_ground_begin_with_the_right_one_of_two_motions():
    odometry, _ = flown([Flight().image(2 * number) for number in range(6)])
    R, _ = Flight().motion(0, 10)
    assert np.linalg.norm(se3.rotation_vector(odometry.finish()[-1].R @ R.T)) < np.deg2rad(0.5)
