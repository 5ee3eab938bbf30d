"""Tags in pictures of real cameras: `python benchmarks/landmarks/real_cameras.py [--photos DIR]`.

A table of how the errors of corners and poses go with their covariances, a row for each camera of
tests/landmarks/camera_pictures.py, whose renderer shares no code with the project; and, if the
folder of recordings is given, of how the poses of two tags beside one another agree in photographs.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "landmarks"))
import camera_pictures
from camera_pictures import CAMERAS, Camera

from ros_visualise.data import CameraInfo, Header, Hypothesis, Image
from ros_visualise.nodes.tag_detector import TagDetector, TagParams

INSIDE_POSE, INSIDE_CORNERS = 12.59, 15.51
"""Of chi squared of 6 and of 8 numbers, 95% are below these."""
PHOTOS = CameraInfo(612, 816, np.array([[765.0, 0, 393.72], [0, 764.18, 304.66], [0, 0, 1]]))
Pose = tuple[np.ndarray, np.ndarray, np.ndarray]
"""R, t, and the covariance of t and of a rotation about the camera's axes."""


def rotation(quat_xyzw: np.ndarray) -> np.ndarray:
    x, y, z, w = quat_xyzw
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def pose_of(found: Hypothesis) -> Pose:
    return rotation(found.quat_xyzw), found.position_xyz, found.covariance


def distance(one: Pose, R: np.ndarray, t: np.ndarray) -> float:
    """Squared, in standard deviations."""
    error = np.concatenate([t - one[1], cv2.Rodrigues(R @ one[0].T)[0].ravel()])
    return float(error @ np.linalg.solve(one[2], error))


def rendered(camera: Camera, count: int, seeds: list[int], readout_s: float) -> str:
    """The cells of a row: pictures of each seed are those of one camera."""
    values = np.array([one for seed in seeds for one in errors(camera, count, seed, readout_s)])
    off, poses, corners = values.T
    return (
        f"{len(off)} | {np.median(off):.3f} | {np.max(off):.2f} | {np.mean(poses):.2f}"
        f" | {np.mean(poses < INSIDE_POSE):.3f} | {np.mean(corners):.2f}"
        f" | {np.mean(corners < INSIDE_CORNERS):.3f}"
    )


def errors(
    camera: Camera, count: int, seed: int, readout_s: float
) -> Iterator[tuple[float, float, float]]:
    """Largest error of a tag's corners, pixels; of its pose and corners in deviations, squared."""
    size = camera_pictures.HEIGHT, camera_pictures.WIDTH
    info = CameraInfo(*size, camera.matrix, np.array(camera.D), distortion_model=camera.model)
    params = TagParams(size=camera_pictures.SIZE_M, readout=readout_s)
    node = TagDetector(params)
    for number, seen in enumerate(camera_pictures.sights(camera, count, seed)):
        header = Header(round((number + 1) * camera_pictures.INTERVAL_S * 1e9), "camera")
        image = Image(seen.gray, "mono8", header, info)
        for found in node.step(image, params)["detections"].detections:
            if found.id == str(seen.id) and found.hypotheses[0].covariance.any():
                error = (found.corners_uv - seen.corners_uv).ravel()
                several = [pose_of(one) for one in found.hypotheses]
                yield (
                    float(np.abs(error).max()),
                    min(distance(one, seen.pose.R, seen.pose.t) for one in several),
                    float(error @ np.linalg.solve(found.corners_covariance, error)),
                )


def between(a: Pose, b: Pose) -> Pose:
    """The pose of b in the frame of a."""
    away = a[0].T @ (b[1] - a[1])
    x, y, z = b[1] - a[1]
    turned = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    by_a = np.block([[-a[0].T, a[0].T @ turned], [np.zeros((3, 3)), -a[0].T]])
    by_b = np.block([[a[0].T, np.zeros((3, 3))], [np.zeros((3, 3)), a[0].T]])
    return a[0].T @ b[0], away, by_a @ a[2] @ by_a.T + by_b @ b[2] @ by_b.T


def photographed(folder: Path) -> None:
    """Two tags on a wall are in two photographs as far from one another."""
    params = TagParams(size=0.127)
    node, photos = TagDetector(params), []
    for number, path in enumerate(sorted(folder.glob("*.JPG"))):
        header = Header((number + 1) * 10**9, "camera")
        image = Image(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), "mono8", header, PHOTOS)
        found = node.step(image, params)["detections"].detections
        photos.append({one.id: [pose_of(pose) for pose in one.hypotheses] for one in found})
    values = []
    for one, other in itertools.combinations(photos, 2):
        for a, b in itertools.combinations(sorted(set(one) & set(other)), 2):
            values.append(
                min(
                    distance((first[0], first[1], first[2] + second[2]), second[0], second[1])
                    for first in itertools.starmap(between, itertools.product(one[a], one[b]))
                    for second in itertools.starmap(between, itertools.product(other[a], other[b]))
                )
            )
    inside = sum(value < INSIDE_POSE for value in values)
    print(f"| {len(photos)} photographs | {len(values)} pairs | {np.mean(values):.2f} | {inside} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--photos", type=Path, help="folder of recordings")
    parser.add_argument("--count", type=int, default=60, help="tags of each camera and seed")
    parser.add_argument("--seeds", type=int, nargs="+", default=[2, 11])
    parser.add_argument("--cameras", nargs="*", choices=CAMERAS, default=list(CAMERAS))
    asked = parser.parse_args()
    print("| camera | found | median px | largest px | poses | inside 95% | corners | inside 95% |")
    for name in asked.cameras:
        camera = CAMERAS[name]
        unknown = {f"{name}, unknown readout": -1.0} if camera.readout_s else {}
        for row, readout_s in {name: camera.readout_s, **unknown}.items():
            print(
                f"| {row} | {rendered(camera, asked.count, asked.seeds, readout_s)} |", flush=True
            )
    if asked.photos:
        print("\n| photographs | pairs of tags | mean | inside 95% |")
        photographed(asked.photos / "tags" / "swatbotics")


if __name__ == "__main__":
    main()
