"""The least squares of a calibration: held against OpenCV, and against its own covariance."""

import cv2
import numpy as np
import pytest
from board_pictures import poses_of

from ros_visualise.landmarks.calibration.adjustment import adjust, begin
from ros_visualise.landmarks.calibration.boards import BoardKind, board_of, points_xy
from ros_visualise.landmarks.calibration.calibrating import better_lens, calibrate
from ros_visualise.landmarks.calibration.finding import BoardPoints
from ros_visualise.landmarks.calibration.lenses import MODELS, Lens, project
from ros_visualise.landmarks.calibration.views import BoardView

SIZE = (640, 480)
BOARD = board_of(BoardKind.CHESSBOARD, "7x5", 0.03)
CAMERAS = {
    Lens.PINHOLE: [510, 512, 322, 236, -0.25, 0.08, 0.001, -0.0005, 0],
    Lens.RATIONAL: [510, 512, 322, 236, 0.4, 0.2, 0.001, -0.0005, 0.02, 0.7, 0.3, 0.05],
    Lens.FISHEYE: [260, 261, 322, 236, 0.02, -0.01, 0.004, -0.001],
}


def make_views(lens, seed, count=10, noise=0.1, **how):
    """What a camera sees of boards, with errors of the pixels."""
    random = np.random.default_rng(seed)
    xyz = np.column_stack([points_xy(BOARD), np.zeros(35)])
    made = []
    for number, pose in enumerate(poses_of(BOARD, count, random, 0.9, **how)):
        uv, _, _ = project(xyz, pose, np.array(CAMERAS[lens], float), MODELS[lens])
        uv += random.normal(0, noise, uv.shape)
        made.append(BoardView(f"{number}", BOARD, BoardPoints(np.arange(35), uv), SIZE))
    return made


def fit_of(views, lens):
    return adjust(views, MODELS[lens], begin(views, MODELS[lens]))


@pytest.mark.parametrize("lens", [*Lens])
def test_exact_points_give_the_camera_itself(lens):
    views = make_views(lens, 1, noise=0, spread=0.5)
    fit = fit_of(views, lens)
    assert fit.rms < 1e-5
    for view, pose in zip(views, fit.poses, strict=True):
        uv, _, _ = project(view.points_xyz, pose, np.array(CAMERAS[lens], float), MODELS[lens])
        assert np.abs(uv - view.points.uv).max() < 0.01


def test_numbers_and_deviations_are_those_of_opencv():
    views = make_views(Lens.PINHOLE, 2)
    fit = fit_of(views, Lens.PINHOLE)
    given = [[view.points_xyz.astype(np.float32) for view in views]]
    given.append([view.points.uv.astype(np.float32) for view in views])
    rms, K, D, _, _, deviations, *_ = cv2.calibrateCameraExtended(*given, SIZE, None, None)
    assert fit.rms == pytest.approx(rms, rel=1e-3)
    assert fit.numbers[:4] == pytest.approx(K[[0, 1, 0, 1], [0, 1, 2, 2]], abs=0.02)
    assert fit.numbers[4:] == pytest.approx(D.ravel(), abs=2e-3)
    assert np.sqrt(np.diag(fit.covariance)) == pytest.approx(deviations[:9, 0], rel=0.02)


@pytest.mark.parametrize("lens", [Lens.PINHOLE, Lens.FISHEYE])
def test_errors_are_as_large_as_their_covariance_says(lens):
    """The mean of the normalized squared errors lies in the band of 99% of chi-square."""
    true = np.array(CAMERAS[lens], float)
    squares = []
    for seed in range(25):
        fit = fit_of(make_views(lens, 100 + seed, count=8), lens)
        error = fit.numbers - true
        squares.append(error @ np.linalg.solve(fit.covariance, error))
    count = len(true)
    assert abs(np.mean(squares) - count) < 2.6 * np.sqrt(2 * count / len(squares))


def test_a_bad_view_is_named_and_left_out():
    views = make_views(Lens.PINHOLE, 3)
    worse = views[4].points.uv + np.random.default_rng(0).normal(0, 3, (35, 2))
    views[4] = BoardView("blurred", BOARD, BoardPoints(np.arange(35), worse), SIZE)
    found = calibrate(views, Lens.PINHOLE)
    assert [view.name for view, _ in found.outliers] == ["blurred"]
    assert found.fit.rms == pytest.approx(0.14, abs=0.02)


def test_a_point_that_lies_astray_is_left_out():
    views = make_views(Lens.PINHOLE, 4)
    views[2].points.uv[7] += 4
    assert calibrate(views, Lens.PINHOLE).stray == 1


def test_views_that_are_alike_are_told_by_halves_and_uncertainty():
    good = calibrate(make_views(Lens.PINHOLE, 5, count=20), Lens.PINHOLE)
    flat = calibrate(make_views(Lens.PINHOLE, 5, count=20, tilt=0.02, spread=0.05), Lens.PINHOLE)
    assert good.halves.difference < 0.005 < flat.halves.difference
    assert flat.uncertainty.corners > 5 * good.uncertainty.corners


@pytest.mark.parametrize(
    ("true", "chosen", "better"),
    [
        (Lens.FISHEYE, Lens.PINHOLE, Lens.FISHEYE),
        (Lens.PINHOLE, Lens.PINHOLE, None),
        (Lens.PINHOLE, Lens.RATIONAL, Lens.PINHOLE),
    ],
)
def test_the_lens_that_predicts_best_is_told(true, chosen, better):
    views = make_views(true, 6, count=14, spread=0.6, noise=0.05)
    assert better_lens(calibrate(views, chosen)) is better
