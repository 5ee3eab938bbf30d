"""Following a landing target: laws of its filter, and its pose in the body's axes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from seeds import mean_band, runs

from ros_visualise.data import Hypothesis
from ros_visualise.estimation.landing.relative import Autopilot, relative_to
from ros_visualise.estimation.landing.tracking import TargetMotion, TargetTracker
from ros_visualise.estimation.localization.estimate import known as target_at
from ros_visualise.estimation.localization.robot_error import ErrorModel
from ros_visualise.estimation.localization.seen import Ground, sighting_of
from ros_visualise.geometry.rotations import from_matrix, from_rpy, to_matrix

S = 1_000_000_000
DOWN = np.diag([1.0, -1.0, -1.0])
STANDING = TargetMotion(speed=0.0, drift=0.0)
LEVEL = [0, 0, 0, 1]
GROUND = Ground(np.array([0.0, 0, 1]), 0.0, 0.5)


def camera_at(*place):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = DOWN, place
    return T


def pose(place, camera, sigma=0.02, R=DOWN @ DOWN, score=1.0):
    """A target that is seen at a place of the fixed frame."""
    at = DOWN.T @ (np.asarray(place) - camera[:3, 3])
    covariance = np.diag([sigma**2] * 3 + [0.01**2] * 3)
    found = Hypothesis("pad", score, at, from_matrix(DOWN.T @ R), covariance)
    return sighting_of(found, camera)


def direction(place, camera, sigma=0.01):
    """The same, of which nothing is known but the direction."""
    ray = DOWN.T @ (np.asarray(place) - camera[:3, 3])
    ray /= np.linalg.norm(ray)
    covariance = 1e6 * np.eye(6)
    covariance[:3, :3] = sigma**2 * np.eye(3) + 1e6 * np.outer(ray, ray)
    return sighting_of(Hypothesis("helipad", 1.0, ray, covariance=covariance), camera)


def seen(tracker, time_s, *readings, motion=STANDING, ground=None):
    tracker.observe(round(time_s * S), readings, motion, ground)


def known(tracker, time_s, motion=STANDING):
    """The target by now; of one that stands, in a frame that does not drift, at any time."""
    return tracker.at(round(time_s * S), motion)


def test_views_of_a_target_that_stands_add_up():
    tracker, camera = TargetTracker(), camera_at(0, 0, 5)
    for number in range(4):
        seen(tracker, number, pose((1, 2, 0), camera, 0.02))
    assert known(tracker, 0).position_xyz == pytest.approx([1, 2, 0])
    assert np.sqrt(np.diag(known(tracker, 0).covariance))[:3] == pytest.approx([0.01] * 3, rel=1e-3)


def test_two_kinds_of_target_join_by_their_covariances():
    """As two independent measurements of one place do: weighed by the inverse of each."""
    tracker, camera = TargetTracker(), camera_at(0, 0, 5)
    seen(tracker, 0, pose((0.0, 0, 0), camera, 0.04))
    seen(tracker, 0, direction((0.05, 0, 0), camera, 0.02 / 5))
    weights = 1 / 0.04**2, 1 / 0.02**2
    assert known(tracker, 0).position_xyz[0] == pytest.approx(0.04, abs=1e-4)
    assert known(tracker, 0).covariance[0, 0] == pytest.approx(1 / sum(weights), rel=0.01)


def test_a_direction_begins_where_it_meets_the_ground():
    tracker = TargetTracker()
    seen(tracker, 0, direction((2, -1, 0), camera_at(0, 0, 10)))
    assert known(tracker, 0) is None
    seen(tracker, 0, direction((2, -1, 0), camera_at(0, 0, 10)), ground=GROUND)
    assert known(tracker, 0).position_xyz == pytest.approx([2, -1, 0], abs=1e-6)
    assert math.sqrt(known(tracker, 0).covariance[2, 2]) == pytest.approx(0.5, rel=0.01)


def test_what_moves_evenly_is_followed_and_known_ahead():
    tracker, motion = TargetTracker(), TargetMotion(speed=1.0, acceleration=0.3)
    random = np.random.default_rng(2)
    for step in range(40):
        time_s = step / 10
        place = np.array([time_s, 0.5 * time_s, 0.3]) + 0.02 * random.standard_normal(3)
        seen(tracker, time_s, pose(place, camera_at(0, 0, 5)), motion=motion)
    ahead = tracker.at(round(4.9 * S), motion)
    assert ahead.velocity_xyz == pytest.approx([1, 0.5, 0], abs=0.15)
    assert ahead.position_xyz == pytest.approx([4.9, 2.45, 0.3], abs=0.15)


def test_what_is_not_seen_is_less_and_less_sure():
    tracker, motion = TargetTracker(), TargetMotion()
    for step in range(10):
        seen(tracker, step / 10, pose((0, 0, 0), camera_at(0, 0, 5)), motion=motion)
    sizes = [np.trace(tracker.at(round(t * S), motion).covariance) for t in (0.9, 1.2, 1.6, 2.4)]
    assert sizes == sorted(sizes)
    assert sizes[-1] > 10 * sizes[0]


def test_the_filter_is_as_sure_as_it_is_right():
    """Mean squared distance of 6 numbers, 60 runs of a target that it describes: near 6."""
    random, motion, distances = np.random.default_rng(4), TargetMotion(1.0, 0.5, drift=0.0), []
    for _ in range(60):
        tracker, camera = TargetTracker(), camera_at(0, 0, 5)
        place, velocity = np.zeros(3), random.standard_normal(3)
        for step in range(20):
            seen(
                tracker,
                step / 10,
                pose(place + 0.02 * random.standard_normal(3), camera),
                motion=motion,
            )
            told = known(tracker, step / 10, motion)
            off = np.concatenate([told.position_xyz, told.velocity_xyz])
            off -= np.concatenate([place, velocity])
            kick = 0.5 * random.multivariate_normal([0, 0], _NOISE, size=3)
            place = place + 0.1 * velocity + kick[:, 0]
            velocity = velocity + kick[:, 1]
        part = known(tracker, 1.9, motion).covariance[np.ix_(_MOVES, _MOVES)]
        distances.append(off @ np.linalg.solve(part, off))
    assert 5.0 < np.mean(distances) < 7.1


_MOVES = [0, 1, 2, 6, 7, 8]
_NOISE = np.array([[0.1**3 / 3, 0.1**2 / 2], [0.1**2 / 2, 0.1]])


def test_a_sighting_that_contradicts_is_refused():
    tracker, camera = TargetTracker(), camera_at(0, 0, 5)
    for time_s, x in enumerate((0, 0, 3.0, 0)):
        seen(tracker, time_s, pose((x, 0, 0), camera))
    assert tracker.refused == 1
    assert known(tracker, 0).position_xyz == pytest.approx([0, 0, 0], abs=1e-6)


def test_a_first_sighting_that_was_wrong_gives_way_to_those_that_follow():
    """1 m off, then 199 right ones at 20 Hz: it is replaced after three of them."""
    tracker, camera = TargetTracker(), camera_at(0, 0, 5)
    seen(tracker, 0, pose((1, 0, 0), camera))
    for step in range(1, 200):
        seen(tracker, step / 20, pose((0, 0, 0), camera))
        told = known(tracker, step / 20)
        assert abs(told.position_xyz[0]) < 3 * math.sqrt(told.covariance[0, 0])
    assert (tracker.refused, tracker.replaced) == (3, 1)
    assert told.position_xyz == pytest.approx([0, 0, 0], abs=1e-6)


def test_a_pad_that_was_moved_is_believed_after_the_stated_time_and_doubted_before():
    tracker, camera, motion = TargetTracker(), camera_at(0, 0, 5), TargetMotion(0.0)
    for step in range(100):
        seen(tracker, step / 20, pose((0, 0, 0), camera), motion=motion)
    sigmas, places = [], []
    for step in range(100, 130):
        seen(tracker, step / 20, pose((1, 0, 0), camera), motion=motion)
        told = known(tracker, step / 20, motion)
        sigmas.append(math.sqrt(told.covariance[0, 0]))
        places.append(told.position_xyz[0])
    assert places == pytest.approx([0] * 10 + [1] * 20, abs=0.02)
    assert sigmas[:10] == sorted(sigmas[:10])
    assert sigmas[5] > 0.3
    assert sigmas[-1] < 0.01
    assert tracker.replaced == 1


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_clutter_does_not_replace_what_is_still_seen(share):
    random = np.random.default_rng(6)
    tracker, camera, motion = TargetTracker(), camera_at(0, 0, 5), TargetMotion(0.0)
    for step in range(400):
        is_clutter = step > 5 and random.random() < share
        place = random.uniform(-3, 3, 3) * [1, 1, 0] if is_clutter else np.zeros(3)
        seen(tracker, step / 20, pose(place, camera), motion=motion)
        told = known(tracker, step / 20, motion)
        assert np.linalg.norm(told.position_xyz) < 0.05
    assert tracker.replaced == 0


def test_sightings_that_agree_with_nothing_do_not_leave_it_sure():
    random = np.random.default_rng(7)
    tracker, camera, motion = TargetTracker(), camera_at(0, 0, 5), TargetMotion(0.0)
    for step in range(100):
        seen(tracker, step / 20, pose((0, 0, 0), camera), motion=motion)
    for step in range(100, 109):
        place = random.uniform(2, 6, 3) * [1, 1, 0]
        seen(tracker, step / 20, pose(place, camera), motion=motion)
    assert known(tracker, 5.4, motion).covariance[0, 0] > 1


def test_a_frame_that_drifts_is_part_of_the_uncertainty():
    """Mean squared distance of 3 numbers, runs of 60 images, speed=0: near 3."""
    random, motion, distances = np.random.default_rng(8), TargetMotion(0.0, drift=0.02), []
    for _ in range(count := runs(30, of=60)):
        tracker, camera, place = TargetTracker(), camera_at(0, 0, 5), np.zeros(3)
        for step in range(60):
            place = place + 0.02 * math.sqrt(0.1) * random.standard_normal(3)
            noisy = place + 0.02 * random.standard_normal(3)
            seen(tracker, step / 10, pose(noisy, camera), motion=motion)
        told = known(tracker, 5.9, motion)
        off = told.position_xyz - place
        distances.append(off @ np.linalg.solve(told.covariance[:3, :3], off))
    low, high = mean_band(3, count)
    assert low < np.mean(distances) < high
    assert tracker.replaced == 0


def test_of_two_readings_the_level_one_is_taken():
    tracker, camera = TargetTracker(), camera_at(0, 0, 5)
    tilted = pose((0, 0, 0.1), camera, R=to_matrix(from_rpy([0.6, 0, 0])), score=0.55)
    seen(tracker, 0, tilted, pose((0, 0, 0), camera, score=0.45))
    assert pytest.approx(np.eye(3), abs=1e-6) == known(tracker, 0).R_fixed_landmark


def test_in_the_bodys_axes_it_is_where_it_is():
    """A body that heads north, 5 m above a target that lies 2 m ahead and 1 m to the right."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = to_matrix(from_rpy([0, 0, math.pi / 2])), [10, 20, 5]
    known = np.diag([0.01, 0.04, 0.09, 1e-4, 2e-4, 3e-4, 1, 1, 1])
    target = target_at(np.array([11.0, 22, 0]), T[:3, :3], known)
    place, quat, covariance = relative_to(T, target, Autopilot.NONE)
    assert place == pytest.approx([2, -1, -5])
    assert quat == pytest.approx([0, 0, 0, 1])
    assert np.diag(covariance) == pytest.approx([0.04, 0.01, 0.09, 2e-4, 1e-4, 3e-4])
    place, quat, turned = relative_to(T, target, Autopilot.ARDUPILOT)
    assert place == pytest.approx([2, 1, 5])
    assert quat == pytest.approx([0, 0, 0, 1])
    flip = np.kron(np.eye(2), np.diag([1, -1, -1]))
    assert turned == pytest.approx(flip @ covariance @ flip)


def test_px4_takes_where_it_is_from_its_own_origin_north_east_down():
    """MAV_FRAME_LOCAL_NED: 11 m east and 22 m north of the origin, at its height."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = to_matrix(from_rpy([0.1, 0.2, 2.0])), [10, 20, 5]
    sure = np.diag([0.01, 0.04, 0.09, 1e-4, 2e-4, 3e-4, 1, 1, 1])
    facing_east = target_at(np.array([11.0, 22, 0.5]), np.eye(3), sure)
    place, quat, covariance = relative_to(T, facing_east, Autopilot.PX4)
    assert place == pytest.approx([22, 11, -0.5])
    assert quat == pytest.approx(from_rpy([0, 0, math.pi / 2]))  # 90 degrees clockwise from north
    assert np.diag(covariance) == pytest.approx([0.04, 0.01, 0.09, 2e-4, 1e-4, 3e-4])
    north = replace(facing_east, R_fixed_landmark=to_matrix(from_rpy([0, 0, math.pi / 2])))
    assert relative_to(T, north, Autopilot.PX4).quat_xyzw == pytest.approx(LEVEL)


def test_a_target_turned_to_the_left_has_a_yaw_that_is_negative_about_an_axis_that_points_down():
    target = target_at(np.zeros(3), to_matrix(from_rpy([0, 0, 0.3])), np.eye(9))
    quat = relative_to(np.eye(4), target, Autopilot.ARDUPILOT).quat_xyzw
    assert quat == pytest.approx(from_rpy([0, 0, -0.3]))


@pytest.mark.parametrize("autopilot", Autopilot)
def test_an_error_of_the_cameras_attitude_counts_by_the_distance_however_often_it_is_seen(
    autopilot,
):
    camera, error = camera_at(1000, 0, 8), ErrorModel(0.0, 0.01, attitude_s=1e6)
    tracker, T = TargetTracker(), np.eye(4)
    T[:3, 3] = camera[:3, 3]
    for step in range(100):
        found = pose((1000, 0, 0), camera, 1e-3)
        tracker.observe(step * S // 10, [found], STANDING, None, error)
    covariance = relative_to(T, known(tracker, 9.9), autopilot).covariance
    assert np.sqrt(np.diag(covariance))[:3] == pytest.approx([0.08, 0.08, 0], abs=1e-3)
    assert np.sqrt(np.diag(covariance))[3:] == pytest.approx([0.01] * 3, rel=0.2)
    assert np.linalg.eigvalsh(covariance).min() > -1e-12
    near = camera_at(1000, 0, 0.1)
    for step in range(100, 110):
        found = pose((1000, 0, 0), near, 1e-3)
        tracker.observe(step * S // 10, [found], STANDING, None, error)
    assert np.sqrt(known(tracker, 10.9).covariance[0, 0]) < 0.01
