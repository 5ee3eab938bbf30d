"""The least squares of a calibration: held against OpenCV, and against its own covariance."""

import cv2
import numpy as np
import pytest
from board_pictures import poses_of
from seeds import mean_band, runs

from ros_visualise.landmarks.calibration.adjustment import adjust, begin
from ros_visualise.landmarks.calibration.boards import BoardKind, board_of, points_xy
from ros_visualise.landmarks.calibration.calibrating import better_lens, calibrate
from ros_visualise.landmarks.calibration.finding import BoardPoints, find_board
from ros_visualise.landmarks.calibration.lenses import MODELS, Lens, project
from ros_visualise.landmarks.calibration.views import BoardView

SIZE = (640, 480)
CAMERAS_TRIED = runs(12, of=30)
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


def test_numbers_and_deviations_are_those_of_opencv_where_errors_are_independent():
    """OpenCV's boards are flat, so ours may be up to half as unsure again."""
    views = make_views(Lens.PINHOLE, 2, count=40)
    fit = fit_of(views, Lens.PINHOLE)
    given = [[view.points_xyz.astype(np.float32) for view in views]]
    given.append([view.points.uv.astype(np.float32) for view in views])
    rms, K, _, _, _, deviations, *_ = cv2.calibrateCameraExtended(*given, SIZE, None, None)
    assert fit.rms == pytest.approx(rms, rel=0.01)
    assert fit.numbers[:4] == pytest.approx(K[[0, 1, 0, 1], [0, 1, 2, 2]], abs=0.5)
    ratios = np.sqrt(np.diag(fit.covariance)) / deviations[:9, 0]
    assert 0.8 < ratios.min() <= ratios.max() < 1.6


def pinhole(points_xyz, numbers):
    """Brown's equations, written down anew, so that no code of ours judges itself."""
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = numbers
    x, y = points_xyz[:, 0] / points_xyz[:, 2], points_xyz[:, 1] / points_xyz[:, 2]
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.column_stack([fx * u + cx, fy * v + cy])


def shared_errors(xy, random):
    """Pixels (N, 2) as of light or blur: a smooth field that is another one in each view."""
    x, y = (xy - xy.mean(axis=0)).T / 0.1
    return (random.normal(0, 0.15, (2, 6)) @ [x**0, x, y, x * x, x * y, y * y]).T


def rolled(points_xyz, uv, random):
    """A board that moves while the rows of the image are read one after the other."""
    return points_xyz + (uv[:, 1:] / SIZE[1] - 0.5) * random.normal(0, 0.005, 3)


@pytest.mark.parametrize("kind", ["white", "shared", "rolling", "bent", "print", "film"])
@pytest.mark.parametrize("count", [8, 25])
def test_errors_are_as_large_as_their_covariance_says(kind, count):
    """Means of 4 squared errors of variance 1 each; too large a covariance does no harm."""
    squares, xy, true = [], points_xy(BOARD), np.array(CAMERAS[Lens.PINHOLE], float)
    for seed in range(CAMERAS_TRIED):
        random, views = np.random.default_rng(seed), []
        bend, start = random.normal(0, 0.001, 2), random.uniform(0, 100)
        printed = random.normal(0, 0.00015, xy.shape)
        for number, pose in enumerate(poses_of(BOARD, count, random, 1.1, spread=0.3)):
            if kind == "film":  # neighbours are alike
                at = start + number * np.array([0.17, 0.23, 0.08, 0.13, 0.11, 0.09])
                pose = np.array([0.5, 0.5, 0.3, 0.05, 0.04, 0.06]) * np.sin(at)
                pose[3:] += [-0.1, -0.07, 0.28]
            x, y = (xy - xy.mean(axis=0)).T / 0.1
            height = (bend[0] * x * x + bend[1] * x * y) * (kind in ("bent", "film"))
            board = np.column_stack([xy, height])
            board[:, :2] += printed * (kind == "print")
            seen = board @ cv2.Rodrigues(pose[:3])[0].T + pose[3:]
            uv = pinhole(seen, true)
            if kind == "rolling":
                uv = pinhole(rolled(seen, uv, random), true)
            uv += random.normal(0, 0.1, uv.shape)
            uv += shared_errors(xy, random) * (kind in ("shared", "film"))
            views.append(BoardView(f"{number}", BOARD, BoardPoints(np.arange(35), uv), SIZE))
        fit = fit_of(views, Lens.PINHOLE)
        error, part = (fit.numbers - true)[:4], fit.covariance[:4, :4]
        squares.append(error @ np.linalg.solve(part, error) / 4)
    assert 0.35 < np.mean(squares) < mean_band(4, CAMERAS_TRIED, z=4)[1] / 4


def test_halves_of_real_pictures_differ_as_much_as_their_deviations_say(recordings):
    """Independent errors would be told 4 times too small: a mean square near 6 instead of 1."""
    board, random, squares = board_of(BoardKind.CHESSBOARD, "9x6"), np.random.default_rng(1), []
    paths = sorted((recordings / "calib" / "opencv").glob("left*.jpg"))
    pictures = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in paths]
    views = [BoardView("", board, find_board(one, board), SIZE) for one in pictures]
    for _ in range(30):
        order = random.permutation(len(views))
        one, other = (
            fit_of([views[i] for i in half], Lens.PINHOLE) for half in (order[:6], order[6:])
        )
        off = (one.numbers - other.numbers)[:4]
        part = (one.covariance + other.covariance)[:4, :4]
        squares.append(off @ np.linalg.solve(part, off) / 4)
    assert 0.35 < np.mean(squares) < 1.6


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
