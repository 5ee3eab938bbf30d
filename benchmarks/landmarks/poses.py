"""Poses of tags, beside other ways to them: `python benchmarks/landmarks/poses.py [--tagslam DIR]`.

Tables of the range of rendered tags, of the boards of TagSLAM's example_13, whose folder is DIR,
and of time. How the errors of poses go with their covariance is in real_cameras.py.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pyapriltags
from rendered_tags import FOCAL, INFO, SIZE_M, Picture, pictures

from ros_visualise.geometry import rotations
from ros_visualise.landmarks.pose import (
    PoseEstimate,
    square_poses,
    squares_poses,
)
from ros_visualise.landmarks.tags import TagFinder, family

FINDER = TagFinder([family("tag36h11")])
PEER = pyapriltags.Detector(families="tag36h11", nthreads=1)
SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) / 2
Pose = tuple[np.ndarray, np.ndarray]


def found_corners(picture: Picture) -> np.ndarray | None:
    tags = FINDER.find(picture.gray)
    return tags[0].corners_uv + picture.origin_uv if tags else None


def ours(picture: Picture) -> tuple[PoseEstimate, ...]:
    tags = FINDER.find(picture.gray)
    if not tags:
        return ()
    uv, noise = tags[0].corners_uv + picture.origin_uv, tags[0].covariance_px2
    return square_poses(uv, SIZE_M, INFO, noise_px2=noise)


def best(picture: Picture) -> Pose | None:
    found = ours(picture)
    return (rotations.to_matrix(found[0].quat_xyzw), found[0].position_xyz) if found else None


def opencv(corners_of: Callable[[Picture], np.ndarray | None], method: int) -> Callable:
    def pose(picture: Picture) -> Pose | None:
        corners = corners_of(picture)
        if corners is None:
            return None
        done, turned, t = cv2.solvePnP(SQUARE * SIZE_M, corners, INFO.K, None, flags=method)
        return (cv2.Rodrigues(turned)[0], t.ravel()) if done else None

    return pose


def aruco_corners(picture: Picture) -> np.ndarray | None:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    found = cv2.aruco.ArucoDetector(dictionary).detectMarkers(picture.gray)[0]
    # OpenCV's pictures of these tags are upside down: its first corner is the lower right one
    return found[0][0][[1, 0, 3, 2]].astype(float) + picture.origin_uv if found else None


def apriltag(picture: Picture) -> Pose | None:
    u, v = INFO.K[:2, 2] - picture.origin_uv + 0.5
    found = PEER.detect(picture.gray, True, (FOCAL, FOCAL, u, v), SIZE_M)
    return (found[0].pose_R @ np.diag([1.0, -1, -1]), found[0].pose_t.ravel()) if found else None


PEERS = {
    "ours": best,
    "pyapriltags' own pose": apriltag,
    "our corners, OpenCV IPPE": opencv(found_corners, cv2.SOLVEPNP_IPPE),
    "our corners, OpenCV ITERATIVE": opencv(found_corners, cv2.SOLVEPNP_ITERATIVE),
    "OpenCV's corners, IPPE": opencv(aruco_corners, cv2.SOLVEPNP_IPPE),
}


def is_wrong_branch(R: np.ndarray, picture: Picture) -> bool:
    """More than 5 degrees off, and nearer to the truth when it is turned over."""
    sight = picture.t / np.linalg.norm(picture.t)
    over = (np.eye(3) - 2 * np.outer(sight, sight)) @ R @ np.diag([1.0, 1, -1])
    normal, other, true = R[:, 2], over[:, 2], picture.R[:, 2]
    return bool(normal @ true < np.cos(np.deg2rad(5)) and other @ true > normal @ true)


def range_table(count: int) -> None:
    print("| poses | side px | tilt | found | range off, median % | 90% | wrong branch |")
    for side, tilt in ((20, 0), (40, 0), (40, 40)):
        made = list(pictures(side, tilt, count))
        for name, pose in PEERS.items():
            poses = [(pose(one), one) for one in made]
            there = [(found, one) for found, one in poses if found]
            off = [abs(np.linalg.norm(p[1]) / np.linalg.norm(one.t) - 1) * 100 for p, one in there]
            wrong = sum(is_wrong_branch(p[0], one) for p, one in there)
            middle, most = np.percentile(off, (50, 90))
            print(
                f"| {name} | {side} | {tilt} | {len(off)} | {middle:.3f} | {most:.3f} | {wrong} |"
            )


def time_table(count: int) -> None:
    made = [one.corners_uv for one in pictures(40, 30, count)]
    print("| poses of so many tags at once | ms |")
    for several in (1, 10, 50):
        corners, sizes = made[:several], [SIZE_M] * several
        took = []
        for _ in range(15):
            begun = time.perf_counter()
            squares_poses(corners, sizes, INFO)
            took.append(time.perf_counter() - begun)
        print(f"| {several} | {np.median(took) * 1e3:.1f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tagslam", type=Path, help="TagSLAM's folder example_13")
    parser.add_argument("--count", type=int, default=100, help="pictures of each kind")
    asked = parser.parse_args()
    range_table(asked.count)
    time_table(max(50, asked.count))
    if asked.tagslam:
        from tagslam_boards import pitch_table

        pitch_table(asked.tagslam)


if __name__ == "__main__":
    main()
