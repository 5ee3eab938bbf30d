"""Speed of the network of the package: `python benchmarks/landmarks/aerial.py DIR`.

DIR has pictures, here or in folders below, such as those of `training/pictures.py`. Milliseconds by
the clock, the median, from a picture to things in its pixels, and how many a second that makes.
Other networks (`--also FILE.onnx`) are measured in turns with it. Nothing else should be running.
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import time
from pathlib import Path

import cv2

from ros_visualise.data import Pixels
from ros_visualise.landmarks.networks.candidates import SelectionRules
from ros_visualise.landmarks.networks.network import Network
from ros_visualise.nodes.landmark_detector import OWN_MODEL

MIN_SCORES = 0.3, 0.4, 0.5


def read_pictures(folder: Path, count: int) -> list[Pixels]:
    """So many of the pictures below a folder, spread over all of them."""
    paths = sorted(path for end in ("jpg", "png") for path in folder.rglob(f"*.{end}"))
    if not paths:
        raise SystemExit(f"{folder}: has no pictures; python training/pictures.py {folder}")
    return [cv2.imread(str(path)) for path in paths[:: max(1, len(paths) // count)][:count]]


def measure(networks: dict[str, Network], pictures: list[Pixels]) -> list[tuple[str, float, float]]:
    """Network, least score, and milliseconds a picture."""
    turns = list(itertools.product(networks, MIN_SCORES))
    times: dict[tuple[str, float], list[float]] = {turn: [] for turn in turns}
    for picture in pictures:
        for name, least in turns:
            start_ns = time.perf_counter_ns()
            networks[name].detect(picture, "BGR", SelectionRules(min_score=least))
            times[name, least].append((time.perf_counter_ns() - start_ns) / 1e6)
    return [(name, least, statistics.median(each)) for (name, least), each in times.items()]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="of pictures")
    parser.add_argument("--also", type=Path, action="append", default=[], metavar="FILE.onnx")
    parser.add_argument("--count", type=int, default=120, help="of pictures")
    parser.add_argument("--threads", type=int, default=2, help="for one picture")
    asked = parser.parse_args()
    files = [OWN_MODEL, *asked.also]
    networks = {str(file): Network(str(file), threads=asked.threads) for file in files}
    pictures = read_pictures(asked.folder, asked.count)
    height, width = pictures[0].shape[:2]
    print(f"{len(pictures)} pictures of {width}x{height}, threads={asked.threads}")
    print("| network | `min_score` | ms | a second |\n|---|---|---|---|")
    for name, least, ms in measure(networks, pictures):
        print(f"| {Path(name).name} | {least} | {ms:.1f} | {1000 / ms:.0f} |")


if __name__ == "__main__":
    main()
