"""Visual odometry beside OpenCV's parts alone: `python benchmarks/visual_odometry.py FILM`.

CPU time of an image, its middle at 640x480, with 200 corners in one thread, image by image in
turns. The parts are what any visual odometry needs: corners where fewer than 70% are left,
pyramidal optical flow there and back, both over the whole pyramid, and an essential matrix.
`--height` adds the height over the ground, for a folder of pictures of a car.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np

from ros_visualise.data import Image, Pixels
from ros_visualise.estimation.visual.focal import USUAL, pinhole
from ros_visualise.estimation.visual.odometry import (
    VisualOdometry,
    VisualSettings,
)
from ros_visualise.messages.recorded import content
from ros_visualise.sources import open_source
from ros_visualise.sources.pictures import Pictures, is_pictures
from ros_visualise.vision import color

SIZE, CORNERS = (640, 480), 200
PATCH = {"winSize": (21, 21), "maxLevel": 4}


class OpenCvParts:
    """What OpenCV alone takes of an image."""

    def __init__(self, K: np.ndarray) -> None:
        self._K = K
        self._before: Pixels | None = None
        self._corners = np.zeros((0, 1, 2), np.float32)

    def step(self, gray: Pixels) -> None:
        if self._before is not None and len(self._corners):
            there, is_there, _ = cv2.calcOpticalFlowPyrLK(
                self._before, gray, self._corners, None, **PATCH
            )
            back, is_back, _ = cv2.calcOpticalFlowPyrLK(gray, self._before, there, None, **PATCH)
            found = (is_there & is_back)[:, 0] > 0
            found &= np.linalg.norm((back - self._corners)[:, 0], axis=1) < 0.7
            if found.sum() > 8:
                pair = self._corners[found, 0], there[found, 0]
                cv2.findEssentialMat(*pair, self._K, cv2.RANSAC, 0.999, 1.0)
            self._corners = there[found]
        if len(self._corners) < 0.7 * CORNERS:
            found_corners = cv2.goodFeaturesToTrack(gray, CORNERS, 0.01, 15)
            self._corners = np.zeros((0, 1, 2), np.float32)
            if found_corners is not None:
                self._corners = found_corners
        self._before = gray


def images(path: Path) -> Iterator[tuple[int, Pixels]]:
    """Stamps and gray images of a folder of pictures or a film."""
    if is_pictures(path):
        for stamp_ns, image in Pictures(path, 10.0).read():
            yield stamp_ns, _small(image)
        return
    with closing(open_source(path)) as source, closing(source.read()) as entries:
        for entry in entries:
            message = content(entry.message)
            if isinstance(message, Image):
                yield entry.stamp_ns, _small(message)


def _small(image: Image) -> Pixels:
    gray = color.to_gray(image.pixels, color.order_of(image.encoding))
    height, width = gray.shape
    middle = slice(max((width - height * 4 // 3) // 2, 0), (width + height * 4 // 3) // 2)
    return np.asarray(cv2.resize(gray[:, middle], SIZE, interpolation=cv2.INTER_AREA))


def measured(step: object, *given: object) -> float:
    """CPU milliseconds of a call."""
    start_ns = time.process_time_ns()
    step(*given)  # type: ignore[operator]
    return (time.process_time_ns() - start_ns) / 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("film", type=Path, help="a film, a recording, or a folder of pictures")
    parser.add_argument("--focal", type=float, default=USUAL, help="in widths of the 4:3 middle")
    parser.add_argument("--height", type=float, default=0.0, help="over the ground, metres")
    asked = parser.parse_args()
    cv2.setNumThreads(1)
    info = pinhole((SIZE[1], SIZE[0]), asked.focal)
    odometry = VisualOdometry([info], None, VisualSettings(CORNERS, asked.height))
    parts = OpenCvParts(info.K)
    own, others, is_key = [], [], []
    for stamp_ns, gray in images(asked.film):
        keyframes = odometry.counts["keyframes"]
        own.append(measured(odometry.step, stamp_ns, gray))
        others.append(measured(parts.step, gray))
        is_key.append(odometry.counts["keyframes"] > keyframes)
    print("| | images | CPU ms: mean | median | longest | keyframe | OpenCV alone | ratio |")
    print("|---|---|---|---|---|---|---|---|")
    key = float(np.mean(np.array(own)[is_key])) if any(is_key) else float("nan")
    print(
        f"| {asked.film.name} | {len(own)}, {sum(is_key)} keyframes | {np.mean(own):.1f} |"
        f" {np.median(own):.1f} | {max(own):.0f} | {key:.0f} | {np.mean(others):.1f} |"
        f" {np.mean(own) / np.mean(others):.2f} |"
    )


if __name__ == "__main__":
    main()
