"""Landmarks from detections: which are one, which are two, what moves, what is left out."""

import gc
import math
from dataclasses import replace

import numpy as np
import pytest
from made_passes import DOWN, detections, direction_seen, looking, tag_noise, tag_seen, turn

from ros_visualise.data import Header
from ros_visualise.data.markers import MarkerAction
from ros_visualise.estimation.localization.localizer import Localizer, LocalizerRules
from ros_visualise.estimation.localization.messages import LandmarkMessages
from ros_visualise.estimation.localization.robot_error import ErrorModel, RobotError, at_camera
from ros_visualise.estimation.localization.seen import Ground
from ros_visualise.estimation.localization.track import LandmarkTrack
from ros_visualise.geometry.se3 import from_parts

SURE = ErrorModel(1e-3, 1e-4)
RULES = LocalizerRules(errors=SURE, ground=Ground(np.array([0, 0, 1.0]), 0.0, 0.1))
TAG = np.array([0.0, 0, 0]), np.eye(3)


def above(x, y=0.0, height=5.0):
    return from_parts(DOWN, [x, y, height])


def see(localizer, T, time_s, *positions, sigma=0.002, class_id="post"):
    several = [[direction_seen(T, at, sigma, class_id=class_id)] for at in positions]
    localizer.observe(detections(time_s, *several), T, RULES)


def see_tag(localizer, T, time_s, *poses, class_id="tag36h11_3"):
    several = [
        [tag_seen(T, at, R, tag_noise(np.linalg.norm(at - T[:3, 3])), class_id=class_id)]
        for at, R in poses
    ]
    localizer.observe(detections(time_s, *several), T, RULES)


def test_a_tag_is_where_it_is_seen_once_it_was_seen_often_enough():
    localizer = Localizer()
    for number in range(5):
        assert len(localizer.landmarks) == (number >= 3)
        see_tag(
            localizer, above(number - 2), number / 10, (np.array([1.0, 2, 0.5]), turn([0, 0, 1]))
        )
    (track,) = localizer.landmarks.values()
    assert (track.name, track.seen, track.class_number) == ("tag36h11_3", 5, 3)
    np.testing.assert_allclose(track.best.position_xyz, [1, 2, 0.5], atol=1e-6)
    np.testing.assert_allclose(track.best.R_fixed_landmark, turn([0, 0, 1]), atol=1e-6)


def test_both_poses_of_a_tag_are_kept_until_views_from_elsewhere_decide():
    localizer = Localizer()
    position, R = np.zeros(3), turn([0.3, 0, 0])
    for number in range(12):
        T = looking([-3 + 0.5 * max(0, number - 5), -4, 4.0], position)
        noise = tag_noise(5.7) / 4
        away = T[:3, :3].T @ R  # the other pose: its normal mirrored at the line of sight
        mirror = turn(math.pi * np.array([0, 0, 1.0]))
        wrong = T[:3, :3] @ mirror @ away @ mirror
        right, other = (
            tag_seen(T, position, R, noise, score=0.5),
            tag_seen(T, position, wrong, noise, score=0.5),
        )
        order = [other, right] if number % 3 == 0 else [right, other]
        localizer.observe(detections(number / 10, order), T, RULES)
        if number == 5:
            (track,) = localizer.landmarks.values()
            assert len(track.branches) == 2
            assert max(track.weights) < 0.6
            assert np.trace(track.covariance[3:, 3:]) > 0.05
    assert len(track.branches) == 1
    np.testing.assert_allclose(track.best.R_fixed_landmark, R, atol=0.02)


def test_an_outlier_is_counted_and_changes_nothing():
    localizer = Localizer()
    for number in range(5):
        see_tag(localizer, above(0), number / 10, TAG)
    before = localizer.landmarks[1].best
    see_tag(localizer, above(0), 0.5, (np.array([1.0, 0, 0]), np.eye(3)))
    assert localizer.skipped == {"elsewhere": 1}
    np.testing.assert_array_equal(localizer.landmarks[1].best.position_xyz, before.position_xyz)


def test_a_tag_that_was_moved_begins_anew_and_that_is_said_once(caplog):
    localizer = Localizer()
    places = [0.0] * 5 + [1.0] * 8 + [2.0] * 8
    for number, x in enumerate(places):
        see_tag(localizer, above(0), number / 10, (np.array([x, 0, 0]), np.eye(3)))
    (track,) = localizer.landmarks.values()
    np.testing.assert_allclose(track.best.position_xyz, [2, 0, 0], atol=1e-6)
    assert [r.getMessage() for r in caplog.records] == [
        "landmark_localizer: tag36h11_3 moved; following it from its new position"
        " (further occurrences suppressed)"
    ]


def test_a_tag_that_was_moved_is_less_sure_before_it_is_elsewhere():
    localizer = Localizer()
    for number in range(30):
        see_tag(localizer, above(0), number / 10, TAG)
    (track,) = localizer.landmarks.values()
    offs, sigmas = [], []
    for number in range(30, 36):
        see_tag(localizer, above(0), number / 10, (np.array([1.0, 0, 0]), np.eye(3)))
        offs.append(track.best.position_xyz[0] - 1)
        sigmas.append(math.sqrt(track.covariance[0, 0]))
    assert offs == pytest.approx([-1, -1, 0, 0, 0, 0], abs=1e-3)
    assert sigmas[0] > 0.2
    assert sigmas[1] > 0.4
    assert sigmas[5] < 0.01


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_false_sightings_of_a_tag_that_is_seen_move_it_only_three_in_a_row(share):
    random, localizer, off = np.random.default_rng(3), Localizer(), []
    for number in range(300):
        is_false = number > 5 and random.random() < share
        place = random.uniform(-2, 2, 3) * [1, 1, 0] if is_false else TAG[0]
        see_tag(localizer, above(0), number / 10, (place, np.eye(3)))
        off.append(np.linalg.norm(localizer.landmarks[1].best.position_xyz) if number > 3 else 0)
    assert np.mean(np.array(off) < 0.05) > 0.97
    assert localizer.skipped["elsewhere"] > 0.8 * share * 300


def test_what_is_forgotten_leaves_nothing_behind():
    """Ten minutes with something else in every third image: as many tracks as after one."""
    random, localizer, alive = np.random.default_rng(5), Localizer(), []
    for number in range(600):
        places = [np.zeros(3), np.array([3.0, 0, 0])]
        if number % 3 == 0:
            places.append(np.array([*random.uniform(-4, 4, 2), 0]))
        see(localizer, above(0.1 * (number % 7)), number, *places)
        if number % 60 == 59:
            gc.collect()
            alive.append(sum(isinstance(one, LandmarkTrack) for one in gc.get_objects()))
    assert alive[-1] <= alive[0] + 5
    assert all(len(track.apart) < 20 for track in localizer.landmarks.values())


def test_a_tag_that_is_there_twice_is_followed_once_and_said(caplog):
    localizer = Localizer()
    for number in range(5):
        see_tag(localizer, above(0), number / 10, TAG, (np.array([1.0, 0, 0]), np.eye(3)))
    assert len(localizer.landmarks) == 1
    assert localizer.skipped == {"duplicate in the image": 5}
    assert "two copies of" in caplog.text


def test_things_of_one_class_are_told_apart_and_keep_their_names():
    localizer = Localizer()
    posts = [np.array([0.0, 0, 0]), np.array([1.0, 0, 0]), np.array([0, 3.0, 0])]
    for number in range(8):
        order = posts if number % 2 else posts[::-1]
        see(localizer, above(0.1 * number), number / 10, *order)
    found = localizer.landmarks.values()
    assert [track.name for track in found] == ["post_1", "post_2", "post_3"]
    at = sorted(tuple(np.round(track.best.position_xyz, 3) + 0.0) for track in found)
    np.testing.assert_allclose(at, sorted(map(tuple, posts)), atol=1e-3)


def test_what_is_seen_too_seldom_is_no_landmark():
    localizer = Localizer()
    for number in range(20):
        see(localizer, above(0), number * 11, np.array([float(number % 2), 0, 0]))
    assert not localizer.landmarks


def test_what_is_surely_apart_stays_two_and_what_may_be_one_becomes_one():
    for sigma, apart, count in ((0.0005, 0.15, 2), (0.02, 0.02, 1)):
        localizer = Localizer()
        for number in range(3):
            see(localizer, above(-1), number / 10, np.zeros(3), sigma=sigma)
        for number in range(3, 12):
            see(localizer, above(1), number / 10, np.array([apart, 0, 0]), sigma=sigma)
        assert len(localizer.landmarks) == count
        assert sum(track.seen for track in localizer.landmarks.values()) == 12


@pytest.mark.parametrize("height_wrong", [0.0, 0.5])
def test_parallax_tells_the_height_where_the_ground_is_not_sure(height_wrong):
    localizer = Localizer()
    rules = LocalizerRules(errors=SURE, ground=Ground(np.array([0, 0, 1.0]), 0.0, 1.0))
    at = np.array([0.0, 0, height_wrong])
    for number in range(30):
        T = looking([-6 + 0.4 * number, -3, 5.0], at)
        localizer.observe(detections(number / 10, [direction_seen(T, at, 0.001)]), T, rules)
    (track,) = localizer.landmarks.values()
    np.testing.assert_allclose(track.best.position_xyz, at, atol=0.02)
    assert track.covariance[2, 2] < 0.02**2


def test_without_a_ground_or_above_it_a_direction_gives_no_landmark():
    localizer = Localizer()
    T = looking([0.0, 0, 2], [5.0, 0, 4])
    for number in range(4):
        see(localizer, T, number / 10, np.array([5.0, 0, 4]))
        localizer.observe(
            detections(number / 10, [direction_seen(above(0), [0, 0, 0], 0.01)]),
            above(0),
            LocalizerRules(),
        )
    assert not localizer.landmarks
    assert localizer.skipped == {"not on the ground": 8}


def test_detections_without_poses_are_counted():
    localizer = Localizer()
    unknown = tag_seen(above(0), *TAG, np.zeros((6, 6)))
    nowhere = replace(tag_seen(above(0), *TAG, np.eye(6)), position_xyz=np.full(3, np.nan))
    unturned = replace(tag_seen(above(0), *TAG, np.eye(6)), quat_xyzw=np.zeros(4))
    impossible = tag_seen(above(0), *TAG, np.diag([1, 1, -1, 1, 1, 1.0]))
    several = [unknown], [], [nowhere], [unturned], [impossible]
    localizer.observe(detections(0, *several), above(0), RULES)
    assert localizer.skipped == {"no pose": 5}


def test_an_odometrys_covariance_is_carried_to_the_camera():
    covariance = np.diag([0.01, 0.02, 0.03, 0, 0, 0.001])
    east, up = np.array([10.0, 0, 0]), turn([0, 0, math.pi / 2])
    moved = at_camera(covariance, up, east)
    np.testing.assert_allclose(np.diag(moved), [0.02, 0.01 + 0.1, 0.03, 0, 0, 0.001], atol=1e-12)


def test_errors_that_grow_along_the_way_stay_in_what_comes_and_corrected_ones_go():
    robot = RobotError()
    grown = [np.diag([s, s, s, s / 10, s / 10, s / 10]) for s in (0.1, 0.4, 0.1)]
    place = np.array([3.0, 0, 1])
    robot.advance(0, place, SURE, grown[0])
    np.testing.assert_allclose(robot.advance(1, place, SURE, grown[1]), np.eye(6), atol=1e-6)
    np.testing.assert_allclose(robot.advance(2, place, SURE, grown[2]), np.eye(6) / 4, atol=1e-6)


def test_the_shapes_of_a_landmark_that_is_no_more_are_deleted():
    localizer, shown = Localizer(), LandmarkMessages()
    for number in range(4):
        see(localizer, above(0), number / 10, np.zeros(3), np.array([1.0, 0, 0]))
    header = Header(1, "map")
    drawn = shown.markers(localizer.landmarks.values(), header).markers
    del localizer.landmarks[2]
    after = shown.markers(localizer.landmarks.values(), header).markers
    gone = {(one.ns, one.id) for one in after if one.action == MarkerAction.DELETE}
    assert gone >= {(one.ns, one.id) for one in drawn if one.id == 2}
    assert {one.id for one in after if one.action == MarkerAction.ADD} == {1}
    again = shown.markers(localizer.landmarks.values(), header).markers
    assert all(one.action == MarkerAction.ADD for one in again)
