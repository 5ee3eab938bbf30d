"""Several cameras on a rig, and calibrations that are not exact."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from made_worlds import INFO, K, drifting, flight, floor, turn, world

from ros_visualise.data import CameraInfo, Detections, Header
from ros_visualise.estimation.mapping.intrinsics import assumed, by_intrinsics, root_of
from ros_visualise.estimation.mapping.mapping import map_of
from ros_visualise.estimation.mapping.problem import (
    CameraPath,
    Problem,
    RigCamera,
    TagPrior,
)
from ros_visualise.estimation.mapping.rig import calibrations_of, cameras_of, rig_as_found, views_of
from ros_visualise.estimation.mapping.smoothing import smooth
from ros_visualise.estimation.mapping.starting import poses
from ros_visualise.estimation.mapping.terms import Terms
from ros_visualise.estimation.mapping.unknowns import MeasurementNoise, SharedPrior, Unknowns
from ros_visualise.geometry.se3 import from_parts, inverse
from ros_visualise.sources.calibration import CalibrationUncertainty

RIGHT = from_parts(turn([0.1, 0.4, -0.05]), [0.3, -0.05, 0.1])
"""T_left_right."""


@pytest.fixture
def random():
    return np.random.default_rng(5)


@pytest.fixture
def tags(random):
    return floor(random, 8, 4.0)


def rig_world(random, tags, views=20, given=RIGHT, sigma_px=0.1, off_by=0.0):
    """What both cameras see; their true focal lengths are longer by a part than is given."""
    left = flight(random, views, 4.0)
    both = [world(random, eyes, tags, sigma_px) for eyes in (left, left @ RIGHT)]
    sightings = [
        replace(
            one, camera=camera, corners_uv=one.corners_uv + off_by * (one.corners_uv - K[:2, 2])
        )
        for camera, problem in enumerate(both)
        for one in problem.sightings
    ]
    cameras = RigCamera("left"), RigCamera("right", given, 0.02, np.deg2rad(2.0))
    return left, Problem(both[0].stamps_ns, both[0].names, sightings, cameras=cameras)


def aligned_off_m(found, tags):
    """How far tags are off, where the first tag of the map is right."""
    first = found.problem.anchor
    T = tags[first] @ inverse(from_parts(found.tags.R[first], found.tags.t[first]))
    here = found.tags.t @ T[:3, :3].T + T[:3, 3]
    numbers = [int(name.rpartition("_")[2]) for name in found.problem.names]
    return np.linalg.norm(here - tags[numbers, :3, 3], axis=1).max()


def test_derivatives_are_those_of_differences(random, tags):
    left, problem = rig_world(random, tags, views=6)
    known = CalibrationUncertainty(np.diag([2.0, 2, 1, 1, 1e-3, 1e-3, 1e-4, 1e-4, 1e-3]) ** 2, INFO)
    problem = replace(problem, cameras=[replace(o, calibration=known) for o in problem.cameras])
    terms = Terms(problem)
    shared = 1e-2 * random.standard_normal(terms.layout.count)
    shared[2:8] = 0
    shared[terms.layout.rig[1]] = 0
    state = Unknowns(poses(left), poses(tags), shared)
    ones = np.ones(len(problem.sightings))
    _, by_pose, by_shared = terms.seen(state, ones)
    by_view, by_tag = terms.by_poses(state, by_pose)
    views, tagged = terms.corners.views, terms.corners.tags
    for number in range(6):
        step = np.zeros(6)
        step[number] = 1e-6
        every = np.tile(step, (len(left), 1)), np.tile(step, (len(tags), 1))
        none = [np.zeros_like(one) for one in every]
        no_shared = np.zeros_like(shared)
        for moved, by in (((every[0], none[1]), by_view), ((none[0], every[1]), by_tag)):
            there, back = (
                terms.seen(state.moved(*(sign * one for one in moved), no_shared), ones)[0]
                for sign in (1, -1)
            )
            np.testing.assert_allclose((there - back) / 2e-6, by[..., number], rtol=1e-4, atol=1e-2)
    assert len(views) == len(tagged)
    for number in range(len(shared)):
        step = 1e-6 * np.eye(len(shared))[number]
        there, back = (
            terms.seen(state._replace(shared=shared + s), ones)[0] for s in (step, -step)
        )
        slope = (there - back) / 2e-6
        np.testing.assert_allclose(slope, by_shared[..., number], rtol=1e-3, atol=2e-2)


def test_a_camera_that_is_turned_in_its_rig_is_estimated_as_surely_as_is_told(tags):
    distances = []
    for seed in range(6):
        random = np.random.default_rng(seed)
        off = from_parts(turn(np.deg2rad(1.0) * random.standard_normal(3)), np.zeros(3))
        found = smooth(rig_world(random, tags, given=RIGHT @ inverse(off))[1])
        [right] = cameras_of(found)
        covariance = found.shared_covariance[10:16, 10:16][3:, 3:]
        error = np.deg2rad(right.turn_deg) - cv2.Rodrigues(off[:3, :3])[0].ravel()
        distances.append(error @ np.linalg.solve(covariance, error))
        assert aligned_off_m(found, tags) < 0.02
    assert 0.8 < np.mean(distances) < 6.5  # 3 expected; 99 of 100 are in between for 18 numbers


@pytest.mark.parametrize(("shift_m", "is_wrong"), [(0.02, False), (0.3, True)])
def test_a_camera_that_is_elsewhere_than_tf_says_is_named_and_pulls_nothing(shift_m, is_wrong):
    """By few views, its given pose would count for more than they do."""
    for seed in range(5, 8):
        random = np.random.default_rng(seed)
        off = from_parts(np.eye(3), shift_m * np.array([0.6, 0.0, 0.8]))
        there = floor(random, 8, 4.0)
        found = map_of(rig_world(random, there, 4, RIGHT @ inverse(off), 0.5)[1])
        [right] = cameras_of(found.smoothed)
        assert right.camera.is_wrong == is_wrong
        assert ("fix its transform" in right.text) == is_wrong
        error_m = np.linalg.norm(right.T_first_camera[:3, 3] - RIGHT[:3, 3])
        assert error_m < min(0.05, 3 * np.linalg.norm(right.sigma_m))


def test_a_camera_that_few_views_cannot_show_to_be_elsewhere_is_as_uncertain_as_it_is_off():
    """By 0.1 m, in views with errors of 1.5 px; its place by tf counts as known to 0.02 m."""
    squares = []
    for seed in range(5, 8):
        random = np.random.default_rng(seed)
        off = from_parts(np.eye(3), 0.1 * np.array([0.6, 0.0, 0.8]))
        there = floor(random, 8, 4.0)
        found = smooth(rig_world(random, there, 6, RIGHT @ inverse(off), 1.5)[1])
        [right] = cameras_of(rig_as_found(found, SharedPrior()))
        error_m = right.T_first_camera[:3, 3] - RIGHT[:3, 3]
        squares.append((error_m / right.sigma_m) ** 2)
    assert np.mean(squares) < 2  # of 1


def test_images_of_one_time_are_one_view_unless_a_camera_is_apart():
    images = [
        (camera, Detections((), Header(stamp_ns))) for stamp_ns in (0, 10**8) for camera in (0, 1)
    ]
    assert [[camera for camera, _ in view] for view in views_of(images, ())] == [[0, 1]] * 2
    assert [[camera for camera, _ in view] for view in views_of(images, {1})] == [[0], [1]] * 2


@pytest.mark.parametrize("model", ["plumb_bob", "equidistant"])
def test_pixels_change_with_a_calibration_as_opencv_has_it(random, model):
    D = np.array([-0.1, 0.02, 1e-3, -1e-3, 0.01]) if model == "plumb_bob" else 0.01 * np.ones(4)
    points = np.column_stack([random.uniform(-0.5, 0.5, (9, 2)), np.ones(9)])

    def pixels(values):
        camera = np.array([[values[0], 0, values[2]], [0, values[1], values[3]], [0, 0, 1]])
        see = cv2.projectPoints if model == "plumb_bob" else cv2.fisheye.projectPoints
        return see(points[:, None], np.zeros(3), np.zeros(3), camera, values[4:])[0].reshape(-1, 2)

    values = np.concatenate([[600.0, 610, 320, 240], D])
    camera = np.array([[600.0, 0, 320], [0, 610, 240], [0, 0, 1]])
    found = by_intrinsics(points, CameraInfo(480, 640, K=camera, D=D, distortion_model=model))
    for number, step in enumerate(1e-6 * np.eye(len(values))):
        slope = (pixels(values + step) - pixels(values - step)) / 2e-6
        np.testing.assert_allclose(found[:, :, number], slope, rtol=1e-4, atol=1e-4)


def test_correlations_of_a_calibration_count(random):
    """Not only its standard deviations."""
    half = random.standard_normal((9, 9))
    known = CalibrationUncertainty(half @ half.T, INFO)
    root = root_of(known, INFO)
    np.testing.assert_allclose(root @ root.T, known.covariance)
    smaller = root_of(known, replace(INFO, K=INFO.K / 2))
    np.testing.assert_allclose(smaller[:4], root[:4] / 2)


def test_a_focal_length_that_is_wrong_is_found_by_the_odometry(random, tags):
    """By 0.8 %; distances of tags are as wrong without it."""
    left, problem = rig_world(random, tags, views=60, off_by=0.008)
    told = drifting(random, left, MeasurementNoise(way_m=1e-3, tilt_rad=1e-4, heading_rad=1e-4))
    problem = replace(problem, odometry=CameraPath(told))
    inexact = [replace(one, calibration=assumed(INFO)) for one in problem.cameras]
    found = smooth(replace(problem, cameras=inexact))
    for one in calibrations_of(found):
        assert abs(one.off[:2] / 600 - 0.008).max() < 0.004
        assert (np.abs(one.off[:2] - 0.008 * 600) < 4 * one.sigma[:2]).all()


def test_a_survey_that_deviates_more_than_given_counts_less(random, tags):
    _, problem = rig_world(random, tags, views=40)
    wrong = tags[:, :3, 3] + 0.05 * random.standard_normal((len(tags), 3))
    numbers = [int(name.rpartition("_")[2]) for name in problem.names]
    given = [TagPrior(n, wrong[number], np.full(3, 0.01)) for n, number in enumerate(numbers)]
    found = map_of(replace(problem, surveyed=given)).smoothed
    assert 3 < found.noise.survey_position < 8  # 5
    good = [TagPrior(n, tags[number, :3, 3], np.full(3, 0.01)) for n, number in enumerate(numbers)]
    assert map_of(replace(problem, surveyed=good)).smoothed.noise.survey_position == 1
