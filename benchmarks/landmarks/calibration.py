"""Calibrating by real pictures, beside others: `python benchmarks/landmarks/calibration.py DATA`.

DATA is the folder of recordings that CONTRIBUTING.md tells of. ROS's cameracalibrator takes part
where its package can be imported, as by Debian's Python; it fails on OpenCV 5.

The second table compares the deviations with how far random halves of the same views are apart:
the mean of (difference / deviation) squared of fx, fy, cx and cy is 1 if the deviations are true.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from ros_visualise.landmarks.calibration.adjustment import adjust, begin
from ros_visualise.landmarks.calibration.boards import BoardKind, board_of, points_xy
from ros_visualise.landmarks.calibration.calibrating import calibrate
from ros_visualise.landmarks.calibration.finding import find_board
from ros_visualise.landmarks.calibration.lenses import MODELS, Lens
from ros_visualise.landmarks.calibration.views import BoardView

SETS = (
    ("opencv left*.jpg", "calib/opencv/left*.jpg", (9, 6)),
    ("swatbotics", "tags/swatbotics/calibration/*.JPG", (7, 5)),
)
STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 1e-3)
Size = tuple[int, int]
Result = tuple[int, float, float, float]
"""Pictures with a board, rms in pixels, focal length, and how far its halves are apart in %."""


def ours(pictures: Sequence[np.ndarray], size: Size) -> Result:
    board = board_of(BoardKind.CHESSBOARD, f"{size[0]}x{size[1]}")
    found = [(find_board(picture, board), picture.shape[::-1]) for picture in pictures]
    views = [BoardView("", board, points, shape) for points, shape in found if points is not None]
    result = calibrate(views, Lens.PINHOLE)
    assert result.halves is not None
    apart = 100 * result.halves.difference
    return len(views), result.fit.rms, float(result.fit.numbers[:2].mean()), apart


def by_tutorial(picture: np.ndarray, size: Size) -> np.ndarray | None:
    """As OpenCV's tutorial does it."""
    is_found, corners = cv2.findChessboardCorners(picture, size)
    return cv2.cornerSubPix(picture, corners, (11, 11), (-1, -1), STOP) if is_found else None


def by_sectors(picture: np.ndarray, size: Size) -> np.ndarray | None:
    is_found, corners = cv2.findChessboardCornersSB(picture, size, flags=cv2.CALIB_CB_ACCURACY)
    return corners if is_found else None


def by_ros(picture: np.ndarray, size: Size) -> np.ndarray | None:
    """As ROS's cameracalibrator finds them; what it refuses is none."""
    if int(cv2.__version__.partition(".")[0]) >= 5:
        raise ImportError
    from camera_calibration.calibrator import ChessboardInfo, MonoCalibrator

    ros = MonoCalibrator([ChessboardInfo("chessboard", *size, 0.03)])
    found = ros.get_corners(picture)
    return found[1] if found[0] else None


def opencv(find: Callable[[np.ndarray, Size], np.ndarray | None]) -> Callable[..., Result]:
    """cv2.calibrateCamera, by corners that are found in some way."""

    def run(pictures: Sequence[np.ndarray], size: Size) -> Result:
        flat = points_xy(board_of(BoardKind.CHESSBOARD, f"{size[0]}x{size[1]}"))
        xyz = np.column_stack([flat, np.zeros(len(flat))]).astype(np.float32)
        seen = [corners for one in pictures if (corners := find(one, size)) is not None]

        def fit(some: list[np.ndarray]) -> tuple[float, float]:
            given = [xyz] * len(some), [one.astype(np.float32) for one in some]
            rms, K, *_ = cv2.calibrateCamera(*given, pictures[0].shape[::-1], None, None)
            return rms, float(K[[0, 1], [0, 1]].mean())

        rms, focal = fit(seen)
        one, other = fit(seen[::2])[1], fit(seen[1::2])[1]
        return len(seen), rms, focal, 100 * abs(one - other) / focal

    return run


Numbers = tuple[np.ndarray, np.ndarray]
"""fx, fy, cx and cy, and their deviations."""


def our_numbers(views: Sequence[BoardView]) -> Numbers:
    model = MODELS[Lens.PINHOLE]
    fit = adjust(views, model, begin(views, model))
    assert fit.covariance is not None
    return fit.numbers[:4], np.sqrt(np.diag(fit.covariance))[:4]


def opencvs_numbers(views: Sequence[BoardView]) -> Numbers:
    xyz = [view.points_xyz.astype(np.float32) for view in views]
    uv = [view.points.uv.astype(np.float32) for view in views]
    found = cv2.calibrateCameraExtended(xyz, uv, views[0].size, None, None)
    return found[1][[0, 1, 0, 1], [0, 1, 2, 2]], found[5][:4, 0]


def compare_deviations(name: str, views: Sequence[BoardView]) -> None:
    """Rows of the second table, by 40 random halves of the views."""
    for peer, run in (("ros_visualise", our_numbers), ("OpenCV, the same points", opencvs_numbers)):
        random, apart, sigmas = np.random.default_rng(1), [], []
        for _ in range(40):
            order, half = random.permutation(len(views)), len(views) // 2
            (one, its), (other, others) = (
                run([views[i] for i in part]) for part in (order[:half], order[half:])
            )
            apart.append(one - other)
            sigmas.append(np.hypot(its, others))
        off, sigma = np.array(apart), np.array(sigmas)
        cells = f"{np.sqrt((off[:, :2] ** 2).mean()):.2f} | {sigma[:, :2].mean():.2f}"
        print(f"| {name} | {peer} | {cells} | {((off / sigma) ** 2).mean():.2f} |")


PEERS: dict[str, Callable[..., Result]] = {
    "ros_visualise": ours,
    "OpenCV's tutorial (window 11)": opencv(by_tutorial),
    "findChessboardCornersSB": opencv(by_sectors),
    "corners of ROS's cameracalibrator": opencv(by_ros),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path)
    data = parser.parse_args().data
    print("| pictures | by | found | rms px | f px | halves apart % | s |")
    print("|---|---|---|---|---|---|---|")
    for name, pattern, size in SETS:
        pictures = [
            cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in sorted(data.glob(pattern))
        ]
        for peer, run in PEERS.items():
            start_s = time.perf_counter()
            try:
                found, rms, focal, apart = run(pictures, size)
            except ImportError:
                continue
            gone_s = time.perf_counter() - start_s
            cells = (
                f"{found} of {len(pictures)} | {rms:.3f} | {focal:.2f} | {apart:.2f} | {gone_s:.2f}"
            )
            print(f"| {name} | {peer} | {cells} |")
    print("\n| pictures | by | halves apart in fx, fy px | told px | mean square |")
    print("|---|---|---|---|---|")
    for name, pattern, size in SETS:
        board = board_of(BoardKind.CHESSBOARD, f"{size[0]}x{size[1]}")
        pictures = [cv2.imread(str(path), 0) for path in sorted(data.glob(pattern))]
        found_in = [(find_board(one, board), one.shape[::-1]) for one in pictures]
        views = [BoardView("", board, points, s) for points, s in found_in if points is not None]
        compare_deviations(name, views)


if __name__ == "__main__":
    main()
