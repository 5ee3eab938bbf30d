"""Places on the ground of what a camera sees, against geometry and against drawn errors."""

import numpy as np
import pytest

from ros_visualise.data import Hypothesis
from ros_visualise.geometry import se3
from ros_visualise.landmarks.georeferencing.ground import (
    ABOVE,
    BELOW,
    FLAT,
    LevelSurface,
    ViewErrors,
    ground_points,
    measured_point,
)
from ros_visualise.sources.camera_poses import angle_quats, optical_quats
from ros_visualise.vision.lens_table import find_lens

SIZE = (4000, 3000)
INFO = find_lens("mini 2", SIZE)
CENTER = np.array([[1999.5, 1499.5]])
OFF = np.array([[700.0, 300.0]])
EXACT = ViewErrors(0, 0, 0, 0, 0, np.zeros((2, 2)))


def pose(yaw, pitch, height=50.0):
    return se3.from_pose([5, 6, height], optical_quats(angle_quats([[yaw, pitch, 0]]))[0])


def place(T, errors=EXACT, pixels=CENTER, surface=None, sigma=1.0):
    noise = np.tile(sigma**2 * np.eye(2), (len(pixels), 1, 1))
    return ground_points(pixels, noise, INFO, T, errors, surface or LevelSurface())


@pytest.mark.parametrize("pitch", [-90, -60, -30, -10])
def test_the_centre_of_an_image_lies_where_the_camera_points(pitch):
    away = 50 / np.tan(np.radians(-pitch))
    expected = 5 + away * np.sin(np.radians(30)), 6 + away * np.cos(np.radians(30)), 0
    found = place(pose(30, pitch), sigma=1e-3)
    np.testing.assert_allclose(found.positions_xyz[0], expected, atol=0.05)  # the Earth is round


def test_what_is_higher_in_the_image_lies_further_along_the_heading():
    pixels = np.array([[1999.5, 499.5], [2999.5, 1499.5]])
    (ahead, right), _, _ = place(pose(90, -90), pixels=pixels)
    reach = 50 * 1000 / INFO.K[0, 0]
    np.testing.assert_allclose(ahead, [5 + reach, 6, 0], atol=1e-3)
    np.testing.assert_allclose(right, [5, 6 - reach, 0], atol=1e-3)


def test_covariances_are_those_of_drawn_errors():
    """At steep and at flat angles, of all errors together."""
    rng = np.random.default_rng(1)
    errors = ViewErrors(0.01, 0.05, 1.5, 1.0, 0.03, np.diag([4.0, 1.0]))
    for pitch in (-80, -30, -12):
        T, pixels = pose(30, pitch), CENTER + OFF
        drawn = []
        for _ in range(400):
            turn = rng.normal(0, [0.01, 0.01, 0.05])
            wrong = T.copy()
            wrong[:3, :3] = se3.exp(np.concatenate([np.zeros(3), turn]))[0] @ T[:3, :3]
            wrong[:3, 3] += [rng.normal(0, 2), rng.normal(0, 1), rng.normal(0, 1.5)]
            pixel = CENTER + OFF * (1 + rng.normal(0, 0.03, (1, 1))) + rng.normal(0, 1, 2)
            surface = LevelSurface(rng.normal(0, 1))
            drawn.append(place(wrong, EXACT, pixel, surface).positions_xyz[0])
        found = place(T, errors, pixels)
        assert found.rejected == [""]
        true = np.cov(np.array(drawn).T)
        np.testing.assert_allclose(found.positions_xyz[0], np.mean(drawn, axis=0), atol=1.5)
        ratios = np.linalg.eigvals(np.linalg.solve(true, found.covariances_m2[0]))
        assert (ratios > 0.75).all()
        assert (ratios < 1.3).all()


def test_flat_angles_are_less_certain_and_finally_rejected():
    errors = ViewErrors(0.0175, 0.05, 1, 1, 0.05, 9 * np.eye(2))
    found = [place(pose(0, pitch), errors) for pitch in (-60, -30, -15, -8)]
    sigmas = [np.sqrt(one.covariances_m2[0, 1, 1]) for one in found]
    assert sigmas == sorted(sigmas)
    assert sigmas[-1] > 30
    reasons = [place(pose(0, pitch), errors).rejected for pitch in (-4, 0, 20)]
    assert reasons == [[FLAT], [ABOVE], [ABOVE]]
    assert place(pose(0, -45, height=-3), errors).rejected == [BELOW]
    assert np.isnan(place(pose(0, 0), errors).positions_xyz).all()


def test_tags_are_placed_by_their_own_distance():
    T = pose(0, -90)
    tag = Hypothesis("tag", 1, np.array([1.0, 2, 40]), covariance=0.01 * np.eye(6))
    position, covariance = measured_point(tag, T, ViewErrors(0.01, 0, 0.5, 9, 0, np.eye(2)))
    np.testing.assert_allclose(position, [6, 4, 10], atol=1e-6)  # 10 m up, whatever the ground
    assert covariance[0, 0] == pytest.approx(1 + 0.01 + 0.4**2)
    assert covariance[2, 2] == pytest.approx(0.25 + 0.01 + 5 * 0.01**2)
