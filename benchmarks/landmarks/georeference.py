"""Consistency of detections that `georeference` places on the Earth.

    python benchmarks/landmarks/georeference.py [--flights 250] [--scale 2] [--photos DIR]

Flights are computed: a drone flies over rolling ground and looks at things that lie on it. The
errors are not those of the node, which takes all of them to be independent and normal: they last
for a flight (a gimbal that is mounted askew, a declination that is not set, a biased receiver, a
barometer that drifts), depend on the heading (a compass beside motors) and on time (images that are
late, at 8 m/s), and come from a lens with distortion, another focal length and another centre than
its data sheet says. Pixels are projected here, without code of the package.

With `--photos DIR` the same features in overlapping pictures of a drone are placed by the pose of
each picture, from its EXIF and XMP data, and the places compared.

NEES of two dimensions is 2 where covariances are honest; below, they are too large. What matters is
the share outside of the 95% ellipse: 5% is honest.
"""

from __future__ import annotations

import argparse
import logging
from collections import Counter
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np

from ros_visualise.data import (
    CameraInfo,
    Detection,
    Detections,
    Header,
    Hypothesis,
    NavSatFix,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry import se3
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.rotations import from_matrix
from ros_visualise.landmarks.georeferencing.ground import (
    LevelSurface,
    ViewErrors,
    ground_points,
)
from ros_visualise.nodes.georeference import Georeference, GeoreferenceParams
from ros_visualise.sources.logs.stills import read_still, still_series
from ros_visualise.sources.pictures import picture_files, read_picture

SIZE = (4000, 3000)
FOCAL_PX = 2773.0  # by the data sheet
DATUM = (47.5, 8.25, 400.0)
S = 1_000_000_000
DETECTIONS = 6  # in a flight
CHI2_95 = 5.991


@dataclass(frozen=True)
class Placed:
    """One detection: its angle below the horizon, its distance, its error, and its NEES."""

    below_deg: float
    range_m: float
    error_m: float
    nees: float


class Flight:
    """The errors of one flight, and its ground."""

    def __init__(self, rng: np.random.Generator, scale: float) -> None:
        self.rng = rng
        self.askew = scale * np.radians(rng.uniform(-1.5, 1.5, 2))  # pitch, roll
        self.declination = scale * np.radians(rng.uniform(-4, 4))
        self.compass = scale * np.radians(rng.uniform(0, 3)), rng.uniform(0, 2 * np.pi)
        self.receiver = scale * rng.normal(0, 2.5, 2)
        self.barometer = scale * rng.uniform(-1.5, 1.5)  # after half an hour
        self.late_s = scale * rng.uniform(0, 0.12)
        self.focal_px = FOCAL_PX * (1 + scale * rng.uniform(-0.07, 0.07))
        self.center = (np.array(SIZE) - 1) / 2 + rng.uniform(-20, 20, 2)
        self.bend = rng.uniform(-0.03, 0.03)
        self.waves = rng.uniform(0, 2 * np.pi, 4), rng.uniform(0.3, 0.9, 4)

    def ground(self, x: float, y: float) -> float:
        """Height of rolling ground, as seen from the point of take-off."""
        (a, b, c, d), (h, i, j, k) = self.waves
        at = lambda x, y: (  # noqa: E731
            h * np.sin(x / 70 + a)
            + i * np.sin(y / 50 + b)
            + j * np.sin((x + y) / 110 + c)
            + k * np.sin((x - y) / 37 + d)
        )
        return float(at(x, y) - at(0, 0))


def axes(yaw: float, pitch: float, roll: float) -> np.ndarray:
    """R_enu_camera: right, down and forward of a camera, by its angles in radians."""
    forward = np.array([np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), np.sin(pitch)])
    level = np.array([np.cos(yaw), -np.sin(yaw), 0])
    down = np.cross(forward, level)
    right = np.cos(roll) * level + np.sin(roll) * down
    return np.column_stack([right, np.cross(forward, right), forward])


def fly(rng: np.random.Generator, scale: float, rejected: Counter[str]) -> list[Placed]:
    """The detections of one flight."""
    params = GeoreferenceParams()
    flight, node = Flight(rng, scale), Georeference(params)
    origin = NavSatFix(*DATUM, np.zeros((3, 3)), 2, header=Header(0, "map"))
    width, height = SIZE
    K = np.array([[FOCAL_PX, 0, (width - 1) / 2], [0, FOCAL_PX, (height - 1) / 2], [0, 0, 1]])
    lens = CameraInfo(height, width, K, np.zeros(0), distortion_model="")
    node.step(params, map_origin=origin, frames=FrameTree())
    node.step(params, lens=lens, frames=FrameTree())
    found: list[Placed] = []
    for number in range(DETECTIONS):
        stamp_ns = (number + 1) * S
        yaw, pitch = rng.uniform(0, 2 * np.pi), np.radians(-rng.uniform(8, 90))
        place = np.array([*rng.uniform(-150, 150, 2), rng.uniform(20, 120)])
        true = axes(yaw, pitch, 0)
        seen = look(flight, true, place)
        if seen is None:
            continue
        thing, pixel = seen
        compass = flight.compass[0] * np.sin(yaw + flight.compass[1])
        shaken = np.radians(0.4) * np.sin(rng.uniform(0, 2 * np.pi, 2))
        told = axes(
            yaw + flight.declination + compass,
            pitch + flight.askew[0] + shaken[0],
            flight.askew[1] + shaken[1],
        )
        drift = flight.barometer * rng.uniform() + rng.choice([-0.1, 0, 0.1])
        course = rng.uniform(0, 2 * np.pi)
        moved = 8 * flight.late_s * np.array([np.cos(course), np.sin(course), 0])
        at = place + moved + [*flight.receiver, drift] + rng.normal(0, [0.5, 0.5, 0])
        frames = FrameTree()
        one = TransformStamped("camera", at, from_matrix(told), Header(stamp_ns, "map"))
        frames.add(Transforms((one,)))
        detection = Detection(
            pixel, np.array([60.0, 40.0]), hypotheses=(Hypothesis("thing", 0.9),), point_uv=pixel
        )
        several = Detections((detection,), Header(stamp_ns, "camera"), None, SIZE)
        answer = node.step(params, detections=several, frames=frames)
        for placed in answer["positions"].detections if answer else ():
            error = placed.position_xyz[:2] - thing[:2]
            covariance = placed.hypotheses[0].covariance[:2, :2]
            below = np.degrees(np.arctan2(place[2] - thing[2], np.linalg.norm((place - thing)[:2])))
            nees = float(error @ np.linalg.solve(covariance, error))
            far = float(np.linalg.norm(place - thing))
            found.append(Placed(float(below), far, float(np.linalg.norm(error)), nees))
    rejected.update(node.report()["rejected"])
    return found


def look(flight: Flight, R: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """A thing on the ground that the camera sees, and its pixel; None if it looks too flat."""
    rng = flight.rng
    for _ in range(200):
        far = place[2] * np.exp(rng.uniform(-1, 2.3))
        angle = rng.uniform(0, 2 * np.pi)
        x, y = place[:2] + far * np.array([np.cos(angle), np.sin(angle)])
        thing = np.array([x, y, flight.ground(x, y)])
        right, down, forward = R.T @ (thing - place)
        if forward <= 0:
            continue
        flat = np.array([right, down]) / forward
        if np.linalg.norm(flat) > 1.2:  # where the polynomial would fold back
            continue
        flat = flat * (1 + flight.bend * flat @ flat)
        pixel = flight.center + flight.focal_px * flat
        if (pixel > 0).all() and (pixel < SIZE).all():
            return thing, pixel + rng.uniform(-4, 4, 2)
    return None


def compare(folder: Path) -> None:
    """Distances of the places of the same features, by pairs of pictures."""
    files = picture_files(folder)
    series = {one.topic: one for one in still_series(files)}
    poses = []
    for number in range(len(files)):
        (one,) = series["tf"].make(number).transforms
        poses.append(se3.from_pose(one.translation_xyz, one.quat_xyzw))
    features = [_features(file) for file in files]
    errors = ViewErrors(np.radians(1), np.radians(3), 1, 1, 0.05, 9 * np.eye(2))
    off, nees = [], []
    for a, b in combinations(range(len(files)), 2):
        if np.linalg.norm(poses[a][:2, 3] - poses[b][:2, 3]) > 60:
            continue
        pairs = _matches(features[a], features[b])
        if len(pairs[0]) < 15:
            continue
        seen = [
            ground_points(
                pixels,
                np.tile(np.eye(2), (len(pixels), 1, 1)),
                read_still(files[n]).lens,
                poses[n],
                errors,
                LevelSurface(),
            )
            for n, pixels in zip((a, b), pairs, strict=True)
        ]
        apart = (seen[0].positions_xyz - seen[1].positions_xyz)[:, :2]
        both = (seen[0].covariances_m2 + seen[1].covariances_m2)[:, :2, :2]
        off.append(np.median(np.linalg.norm(apart, axis=1)))
        nees.append(np.einsum("ni,nij,nj->n", apart, np.linalg.inv(both), apart).mean())
        print(f"{files[a].name} {files[b].name}: {off[-1]:.1f} m, NEES {nees[-1]:.2f}")
    print(
        f"{len(off)} pairs: {np.median(off):.1f} m in the median, {np.max(off):.1f} m in the worst"
        f" one; NEES {np.mean(nees):.2f}"
    )


def _features(file: Path) -> tuple[np.ndarray, np.ndarray]:
    gray = cv2.cvtColor(read_picture(file).pixels, cv2.COLOR_BGR2GRAY)
    small = cv2.resize(gray, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    points, words = cv2.SIFT_create(1500).detectAndCompute(small, None)
    return np.array([one.pt for one in points]) * 4 + 1.5, words


def _matches(
    first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (N, 2) of the same features, which a plane explains."""
    several = cv2.BFMatcher().knnMatch(first[1], second[1], k=2)
    clear = [a for a, b in several if a.distance < 0.7 * b.distance]
    if len(clear) < 20:
        return np.zeros((0, 2)), np.zeros((0, 2))
    a = first[0][[one.queryIdx for one in clear]]
    b = second[0][[one.trainIdx for one in clear]]
    _, mask = cv2.findHomography(a, b, cv2.RANSAC, 12)
    fits = mask.ravel() > 0
    return a[fits], b[fits]


def report(found: list[Placed], name: str) -> None:
    """A row of the table."""
    if not found:
        return
    nees = np.array([one.nees for one in found])
    errors = np.array([one.error_m for one in found])
    outside = 100 * np.mean(nees > CHI2_95)
    print(
        f"| {name} | {len(found)} | {nees.mean():.2f} | {outside:.1f}% | {np.median(errors):.1f}"
        f" | {np.percentile(errors, 95):.1f} | {errors.max():.1f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=250)
    parser.add_argument("--scale", type=float, default=1, help="of all errors of a flight")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--photos", type=Path)
    options = parser.parse_args()
    logging.disable()
    if options.photos:
        compare(options.photos)
        return
    rejected: Counter[str] = Counter()
    found = [
        one
        for flight in range(options.flights)
        for one in fly(np.random.default_rng([options.seed, flight]), options.scale, rejected)
    ]
    print("| below the horizon | placed | NEES | outside 95% | median, m | 95%, m | worst, m |")
    print("|---|---|---|---|---|---|---|")
    for low, high in ((0, 10), (10, 20), (20, 40), (40, 90)):
        part = [one for one in found if low <= one.below_deg < high]
        report(part, f"{low} to {high} degrees")
    report(found, "all")
    print(f"rejected: {dict(rejected)}")


if __name__ == "__main__":
    main()
