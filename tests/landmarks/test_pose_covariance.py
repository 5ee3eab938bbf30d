"""Covariances of poses, against errors whose distribution is known."""

from dataclasses import replace

import cv2
import drawn_tags
import numpy as np
import pytest
from seeds import runs

from ros_visualise.data import CameraInfo, Header, Image
from ros_visualise.geometry import rotations
from ros_visualise.landmarks.pose import (
    EXACT,
    CameraError,
    CornerErrors,
    corner_sigma,
    merged,
    rig_poses,
    square_poses,
    squares_poses,
)
from ros_visualise.landmarks.pose.refinement import turn
from ros_visualise.landmarks.tags import TagFinder, draw_cells, family
from ros_visualise.nodes.tag_detector import TagDetector, TagParams
from ros_visualise.vision.projection import project

K = np.array([[600.0, 0, 319.5], [0, 600, 239.5], [0, 0, 1]])
PINHOLE = CameraInfo(480, 640, K)
SMALL = CameraInfo(240, 320, np.array([[300.0, 0, 159.5], [0, 300, 119.5], [0, 0, 1]]))
FISHEYE = CameraInfo(
    480,
    640,
    K / [[2], [2], [1]],
    np.array([0.02, -0.01, 0.003, -0.001]),
    distortion_model="equidistant",
)
SIZE, TAGS, DRAWN = 0.2, 200, runs(60, of=100)
SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * SIZE / 2
INSIDE = 12.59
"""Of chi squared of 6 numbers 95% are below it."""


def scatter(side_px, degrees, sigma_px, seed=4, info=PINHOLE):
    """True poses R (T, 3, 3) and t (T, 3) of tags all over the image, and their noisy corners."""
    rng = np.random.default_rng(seed)
    about, roll = rng.uniform(0, 2 * np.pi, (2, TAGS))
    none = np.zeros(TAGS)
    axes = np.stack([np.cos(about), np.sin(about), none], axis=1)
    R = turn(axes * np.deg2rad(degrees)) @ np.diag([1.0, -1, -1])
    R = R @ turn(np.stack([none, none, roll], axis=1))
    z = info.K[0, 0] * SIZE / side_px
    t = np.stack([*rng.uniform([[-0.35], [-0.25]], [[0.35], [0.25]], (2, TAGS)), none + 1], 1) * z
    points = (SQUARE @ np.swapaxes(R, 1, 2) + t[:, None]).reshape(-1, 3)
    corners = project(points, info)[0].reshape(TAGS, 4, 2)
    return R, t, corners + rng.normal(size=corners.shape) * sigma_px


def errors_of(found, R, t):
    rest = R @ np.swapaxes(rotations.to_matrix([one.quat_xyzw for one in found]), 1, 2)
    turned = [cv2.Rodrigues(one)[0].ravel() for one in rest]
    return np.concatenate([t - [one.position_xyz for one in found], turned], axis=1)


def nees(found, R, t):
    errors = errors_of(found, R, t)
    return np.array(
        [e @ np.linalg.solve(p.covariance, e) for e, p in zip(errors, found, strict=True)]
    )


def right_ones(found, R):
    """Of each pair of solutions the one that is nearer to the truth."""

    def away(one, true):
        return np.trace(true.T @ rotations.to_matrix(one.quat_xyzw))

    return [
        max(several, key=lambda one: away(one, true))
        for several, true in zip(found, R, strict=True)
    ]


@pytest.mark.parametrize(
    ("side", "degrees", "sigma", "info"),
    [
        (20, 30, 0.15, PINHOLE),
        (20, 60, 0.15, PINHOLE),
        (40, 0, 0.05, PINHOLE),
        (40, 20, 0.3, PINHOLE),
        (80, 10, 0.02, PINHOLE),
        (80, 50, 0.3, PINHOLE),
        (60, 30, 0.1, FISHEYE),
    ],
)
def test_errors_are_as_large_as_the_covariance_says(side, degrees, sigma, info):
    R, t, corners = scatter(side, degrees, sigma, info=info)
    found = squares_poses(corners, [SIZE] * TAGS, info, [sigma] * TAGS)
    assert all(found)
    of_right = nees(right_ones(found, R), R, t)
    # 95% of means of 200 are within 6 +- 0.48; a bit more, as there are many cases
    assert abs(of_right.mean() - 6) < 0.65
    assert np.mean(of_right < INSIDE) > 0.92


@pytest.mark.parametrize(("side", "degrees", "sigma"), [(16, 0, 0.17), (24, 10, 0.1), (40, 0, 0.3)])
def test_of_two_readings_the_merged_one_holds_whichever_is_right(side, degrees, sigma):
    R, t, corners = scatter(side, degrees, sigma)
    found = squares_poses(corners, [SIZE] * TAGS, PINHOLE, [sigma] * TAGS)
    is_wrong = np.array([a is not b[0] for a, b in zip(right_ones(found, R), found, strict=True)])
    expected = sum(1 - several[0].probability for several in found)
    assert is_wrong.sum() > 20
    assert abs(expected - is_wrong.sum()) < 3 * np.sqrt(TAGS / 4)
    of_best = nees([several[0] for several in found], R, t)
    assert of_best.mean() > 20, "the best alone promises too much"
    of_merged = nees([merged(several) for several in found], R, t)
    assert abs(of_merged.mean() - 6) < 1
    assert np.mean(of_merged < INSIDE) > 0.88


def test_rotations_are_about_the_axes_of_the_camera():
    R, t, corners = scatter(60, 40, 0.2, seed=8)
    once = np.repeat(corners[:1] * 0 + project(SQUARE @ R[0].T + t[0], PINHOLE)[0], TAGS, axis=0)
    noisy = once + np.random.default_rng(1).normal(size=once.shape) * 0.2
    found = [one[0] for one in squares_poses(noisy, [SIZE] * TAGS, PINHOLE, [0.2] * TAGS)]
    exact = square_poses(once[0], SIZE, PINHOLE, 0.2)[0].covariance
    sampled = np.cov(errors_of(found, R[:1].repeat(TAGS, 0), t[:1].repeat(TAGS, 0)).T)
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert np.abs((sampled - exact) / scale).max() < 0.25


def test_a_rig_of_tags_is_as_sure_as_it_says():
    R, t, _ = scatter(40, 20, 0.2)
    body = np.concatenate([SQUARE + np.array([x, 0, 0]) for x in (-0.15, 0.15)])
    rng, found = np.random.default_rng(2), []
    for one, at in zip(R[:100], t[:100], strict=True):
        pixels = project(body @ one.T + at, PINHOLE)[0]
        found.append(rig_poses(pixels + rng.normal(size=(8, 2)) * 0.2, body, PINHOLE, 0.2))
    of_right = nees(right_ones(found, R[:100]), R[:100], t[:100])
    assert 5.2 < of_right.mean() < 6.9


def test_a_camera_that_fits_badly_is_seen_in_the_residuals():
    R, t, corners = scatter(60, 30, 0.3)
    found = squares_poses(corners, [SIZE] * TAGS, PINHOLE)
    assert abs(nees(right_ones(found, R), R, t).mean() - 6) < 1
    _, _, sharp = scatter(60, 30, 0.015)
    narrow = squares_poses(sharp, [SIZE] * TAGS, PINHOLE)[0][0]
    assert np.linalg.det(narrow.covariance) < np.linalg.det(found[0][0].covariance) * 1e-8


@pytest.mark.parametrize(
    ("side", "tilt", "blur", "noise"), [(24, 3, 0.6, 2.5), (40, 25, 0.5, 1.0), (64, 60, 1.0, 4.0)]
)
def test_poses_of_detected_tags_are_as_sure_as_they_say(side, tilt, blur, noise):
    """Through the node, with nothing told of the picture but the calibration."""
    info = replace(SMALL, header=Header(0, "camera"))
    R, t, corners = scatter(side, tilt, 0.0, info=info)
    cells, border = draw_cells(family("tag36h11"), 7)
    params = TagParams(size=SIZE, corner_floor=0.0, readout=0.0)
    detector, found = TagDetector(params), {}
    rng = np.random.default_rng(6)
    for number, one in enumerate(corners[:DRAWN]):
        pixels = drawn_tags.draw(cells, border, one, (320, 240), rng, blur, noise)
        image = Image(pixels, "mono8", Header(0, "camera"), info)
        for tag in detector.step(image, params)["detections"].detections:
            found[number] = tag.hypotheses
        detector.reset()
    there = list(found)
    assert len(there) > 0.9 * DRAWN
    R, t = R[there], t[there]
    of_right = nees(right_ones(found.values(), R), R, t)
    # 6, or 4 where what squared deviations are enlarged by for real pictures is too much
    assert 3.3 < of_right.mean() < 6.7, "95% of means of 60 are within 0.9, of 100 within 0.7"
    assert np.mean(of_right < INSIDE) > 0.88, "0.95; 98% of shares of 60 are above 0.88"


def test_corners_in_a_worse_picture_are_told_to_be_worse():
    """Noise of twice the size is twice as bad; and a corner is not found for itself alone."""
    cells, border = draw_cells(family("tag36h11"), 7)
    corners = np.array([[30.0, 90], [90, 95], [95, 35], [35, 30]])
    spreads = []
    for blur, noise in ((0.7, 4), (0.7, 8), (1.4, 8)):
        rng = np.random.default_rng(3)
        gray = drawn_tags.draw(cells, border, corners, (130, 130), rng, blur, noise)
        spreads.append(TagFinder([family("tag36h11")]).find(gray)[0].covariance_px2)
    clear, noisy, soft = (np.sqrt(np.trace(one)) for one in spreads)
    assert noisy / clear == pytest.approx(2, rel=0.3)
    assert soft > 1.15 * noisy
    correlation = spreads[1] / np.sqrt(np.outer(*[np.diag(spreads[1])] * 2))
    assert np.abs(correlation - np.eye(8)).max() > 0.2


def test_corners_that_others_found_are_worse_where_tags_are_small():
    square = np.array([[0.0, 1], [1, 1], [1, 0], [0, 0]])
    sigmas = [corner_sigma(square * side) for side in (15, 20, 30, 60)]
    assert sigmas == sorted(sigmas, reverse=True)
    assert corner_sigma(square[None].repeat(3, 0)).shape == (3,)


@pytest.mark.parametrize("info", [PINHOLE, FISHEYE], ids=["pinhole", "fisheye"])
def test_what_a_calibration_leaves_unsure_is_part_of_it(info):
    """Each pose is told with a calibration of its own, as wrong as is said."""
    camera, rng = CameraError(focal=0.01, center_px=3.0), np.random.default_rng(8)
    R, t, corners = scatter(70, 40, 0.1, info=info)
    found, trusting = [], []
    for one in corners:
        wrong = info.K.copy()
        wrong[[0, 1], [0, 1]] *= 1 + rng.normal(0, camera.focal)
        wrong[:2, 2] += rng.normal(0, camera.center_px, 2)
        told = replace(info, K=wrong)
        found.append(square_poses(one, SIZE, told, 0.1, camera))
        if len(trusting) < 50:
            trusting.append(square_poses(one, SIZE, told, 0.1))
    values = nees(right_ones(found, R), R, t)
    assert 5.2 < values.mean() < 6.9
    assert (values < INSIDE).mean() > 0.91
    assert nees(right_ones(trusting, R[:50]), R[:50], t[:50]).mean() > 60


def test_a_body_knows_the_calibration_no_better_than_each_of_its_tags():
    """Its tags share the error of the focal length, however many they are."""
    camera = CameraError(focal=0.02)
    grid = np.stack(np.meshgrid(range(4), range(4), [0]), axis=-1).reshape(-1, 1, 3)
    points = (0.1 * SQUARE + 0.1 * (grid - [1.5, 1.5, 0])).reshape(-1, 3)
    corners = project(points * [1, -1, 1] + [0, 0, 3.0], PINHOLE)[0]
    (body, *_) = rig_poses(corners, points, PINHOLE, 0.05, camera)
    assert np.sqrt(body.covariance[2, 2]) == pytest.approx(0.02 * 3, rel=0.1)
    (exact, *_) = rig_poses(corners, points, PINHOLE, 0.05)
    assert np.sqrt(exact.covariance[2, 2]) < 0.01


def of_camera(errors, sigma_px, count, seed=3):
    """Poses of ``count`` tags, one in each image, whose corners are off by sigma."""
    R, t, corners = scatter(60, 30, sigma_px, seed)
    known = np.eye(8) * 0.02**2
    found = [
        square_poses(one, SIZE, PINHOLE, None, EXACT, known, errors)
        for one in (corners + np.random.default_rng(5).normal(size=corners.shape) * 0.02)[:count]
    ]
    return nees(right_ones(found, R[:count]), R[:count], t[:count])


@pytest.mark.parametrize("sigma", [0.0, 0.8])
def test_a_camera_shows_its_errors_in_its_images(sigma):
    """Whatever is expected of it: after 50 images its poses are as far off as they claim."""
    errors = CornerErrors(0.3)
    of_camera(errors, sigma, 50, seed=9)
    values = of_camera(errors, sigma, TAGS)
    assert 4.4 < values.mean() < 7.2
    assert (values < INSIDE).mean() > 0.9


def test_a_real_camera_has_at_least_the_floor_where_its_images_show_any_error():
    errors = CornerErrors(0.3)
    assert errors.variance_px2 > 0.3**2
    of_camera(errors, 0.1, 100)
    assert errors.variance_px2 == pytest.approx(0.3**2, rel=0.1)
    rendered = CornerErrors()
    assert rendered.variance_px2 < 0.3**2
    of_camera(rendered, 0.1, 100)
    assert rendered.variance_px2 == pytest.approx(0.1**2, rel=0.3)


def test_a_tag_that_stays_in_place_is_one_witness():
    """Its error is the same in every image, small or large by chance."""
    errors = CornerErrors(0.3)
    _, _, corners = scatter(60, 30, 0.3)
    for _ in range(2):
        square_poses(corners[0], SIZE, PINHOLE, None, EXACT, np.eye(8) * 0.02**2, errors)
    once = errors.variance_px2
    for _ in range(50):
        square_poses(corners[0], SIZE, PINHOLE, None, EXACT, np.eye(8) * 0.02**2, errors)
    assert errors.variance_px2 == once


def test_a_wrong_tag_does_not_spoil_a_camera():
    errors = CornerErrors(0.3)
    of_camera(errors, 0.0, 100)
    before = errors.variance_px2
    _, _, corners = scatter(60, 30, 0.0, seed=21)
    wrong = corners[0] + [[4, 0], [0, 3], [-2, 0], [0, 0]]
    square_poses(wrong, SIZE, PINHOLE, None, EXACT, np.eye(8) * 0.02**2, errors)
    assert errors.variance_px2 < before + 0.01**2
