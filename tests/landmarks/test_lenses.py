"""Tags in pictures of real lenses, which bend their sides."""

from dataclasses import replace

import camera_pictures
import numpy as np
import pytest

from ros_visualise.data import CameraInfo
from ros_visualise.landmarks.tags import TagFinder, draw_cells, family
from ros_visualise.landmarks.tags.fitting import fit_tags

LENSES = ["plumb_bob, k1 -0.10", "plumb_bob, k1 -0.29", "rational_polynomial", "equidistant"]


def calibration_of(camera):
    size = camera_pictures.HEIGHT, camera_pictures.WIDTH
    return CameraInfo(*size, camera.matrix, np.array(camera.D), distortion_model=camera.model)


def seen(camera, side_px, tilt, seed=5):
    rng = np.random.default_rng(seed)
    pose = camera_pictures.random_pose(camera, rng, side_px, tilt)
    gray = camera_pictures.take(camera, pose, 9, rng)
    return gray, camera_pictures.corners_of(camera, pose)


@pytest.mark.parametrize("name", LENSES)
@pytest.mark.parametrize("side_px", [40, 130])
def test_corners_are_exact_through_a_calibrated_lens(name, side_px):
    camera = camera_pictures.CAMERAS[name]
    gray, corners = seen(camera, side_px, tilt=20)
    (tag,) = TagFinder([family("36h11")]).find(gray, info=calibration_of(camera))
    error = (tag.corners_uv - corners).ravel()
    assert np.abs(error).max() < 0.06
    # of chi squared of 8 numbers 99.9% are below 26; the covariance is in the real image's pixels
    assert error @ np.linalg.solve(tag.covariance_px2, error) < 26


def test_a_lens_that_is_not_known_leaves_the_picture_as_it_is():
    camera = camera_pictures.CAMERAS["plumb_bob, k1 -0.29"]
    gray, _ = seen(camera, 60, tilt=20)
    finder, info = TagFinder([family("36h11")]), calibration_of(camera)
    unknown = CameraInfo(480, 640, info.K, info.D, distortion_model="magic")
    (plain,), (other,) = finder.find(gray), finder.find(gray, info=unknown)
    np.testing.assert_array_equal(plain.corners_uv, other.corners_uv)


def test_where_a_lens_folds_back_tags_are_fitted_without_it():
    """Its polynomial gives no ray for the margin of the image."""
    camera = camera_pictures.Camera(D=(-0.29, 0.08, 0.0, 0.0, 0.0), focal=450)
    gray, corners = seen(camera, 60, tilt=20)
    folded = CameraInfo(480, 640, camera.matrix * [[0.2], [0.2], [1]], np.array(camera.D))
    cells, rim = draw_cells(family("36h11"), 9)
    found = fit_tags(gray, corners[None], cells[None], rim, folded)
    assert np.abs(found.corners_uv - corners).max() < 2


@pytest.mark.parametrize(
    ("name", "side_px"),
    [
        ("sharpened by 1.5", 60),
        ("overexposed", 60),
        ("JPEG, quality 60", 110),
        ("all of these", 110),
    ],
)
def test_what_a_camera_makes_of_its_images_moves_no_corner(name, side_px):
    """Sharpening makes halos; too much light, or a halo, ends at the brightest level."""
    camera = replace(camera_pictures.CAMERAS[name], readout_s=0.0, speed_px=0.0)
    errors = []
    for seed in range(4):
        gray, corners = seen(camera, side_px, 20, seed)
        (tag,) = TagFinder([family("36h11")]).find(gray, info=calibration_of(camera))
        error = (tag.corners_uv - corners).ravel()
        errors.append(error @ np.linalg.solve(tag.covariance_px2, error))
        assert np.abs(error).max() < 0.12
    assert np.mean(errors) < 16, "8; 99.9% of means of 4 are below 15.6"


@pytest.mark.parametrize(("side_px", "missing"), [(26, 3), (40, 4), (60, 6)])
def test_a_tag_that_is_cut_off_has_uncertain_corners(side_px, missing):
    """The margin of the image is found as its side."""
    gray, corners = seen(camera_pictures.CAMERAS["ideal"], side_px, 20)
    first = int(corners[:, 0].min()) + missing
    (tag,) = TagFinder([family("36h11")]).find(np.ascontiguousarray(gray[:, first:]))
    error = (tag.corners_uv + np.array([first, 0]) - corners).ravel()
    assert np.abs(error).max() > 3
    assert error @ np.linalg.solve(tag.covariance_px2, error) < 26
