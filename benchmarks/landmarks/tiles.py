"""Cost and gain of `tile=` on 4K images: `python benchmarks/landmarks/tiles.py --also PHOTO.jpg`.

Renders worlds of the training's simulator at 3840x2160, with seeds that nothing was trained on, and
counts the landmarks found by their size, and false detections, without tiles and with them.
Pictures given by `--also` show no landmarks: false detections and time only. Nothing else should be
running.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections import defaultdict
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "training"))

from metrics import iou
from pictures import render_world

from ros_visualise.data import Pixels
from ros_visualise.landmarks.networks.candidates import Candidates, SelectionRules
from ros_visualise.landmarks.networks.network import Network
from ros_visualise.landmarks.networks.tiles import detect_in_tiles
from ros_visualise.nodes.landmark_detector import OWN_MODEL, LandmarkParams

SIZE = 3840, 2160
SIDES = 0, 1280, 640
SIZES_PX = 12, 50, 100, 200, 400
USUAL = SelectionRules(LandmarkParams().min_score, LandmarkParams().max_overlap)


class Measured:
    """The network with one value of `tile`: its times, and what it found."""

    def __init__(self, network: Network, side: int) -> None:
        self.network, self.side = network, side
        self.ms: list[float] = []
        self.hits: dict[int, int] = defaultdict(int)
        self.false = 0

    def detect(self, picture: Pixels) -> Candidates:
        start_ns = time.perf_counter_ns()
        found = detect_in_tiles(self.network, picture, "RGB", USUAL, self.side)
        self.ms.append((time.perf_counter_ns() - start_ns) / 1e6)
        return found


def bin_of(box: np.ndarray) -> int:
    """The largest of `SIZES_PX` that the longer side of a box reaches; -1: smaller than all."""
    return max((each for each in SIZES_PX if each <= (box[2:] - box[:2]).max()), default=-1)


def compare(measured: list[Measured], worlds: int, per_world: int, seed: int) -> dict[int, int]:
    """Fill in what was measured; how many landmarks there are of each size."""
    there: dict[int, int] = defaultdict(int)
    for number in range(worlds):
        for picture, seen, _ in render_world((seed, number), per_world, SIZE):
            clear = [one for one in seen if one.share > 0.5 and bin_of(one.box) > 0]
            for one in clear:
                there[bin_of(one.box)] += 1
            for each in measured:
                found = each.detect(picture)
                for one in clear:
                    right = found.classes == one.kind
                    each.hits[bin_of(one.box)] += bool(
                        (iou(one.box, found.boxes_xyxy[right]) > 0.5).any()
                    )
                true = np.array([one.box for one in seen]).reshape(-1, 4)
                each.false += sum(iou(box, true).max(initial=0) < 0.2 for box in found.boxes_xyxy)
    return there


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--also", type=Path, nargs="*", default=[], help="without landmarks")
    parser.add_argument("--worlds", type=int, default=6)
    parser.add_argument("--per-world", type=int, default=8)
    parser.add_argument("--seed", type=int, default=6100)
    parser.add_argument("--threads", type=int, default=2, help="for one picture")
    asked = parser.parse_args()
    network = Network(str(OWN_MODEL), threads=asked.threads)
    measured = [Measured(network, side) for side in SIDES]
    there = compare(measured, asked.worlds, asked.per_world, asked.seed)
    sizes = [f"{size} px up: {there[size]}" for size in SIZES_PX]
    print(f"{len(measured[0].ms)} pictures, min_score {USUAL.min_score}")
    print(f"| `tile` | ms an image | false | {' | '.join(sizes)} |")
    print("|---" * (3 + len(sizes)) + "|")
    for each in measured:
        shares = [f"{each.hits[size] / max(there[size], 1):.2f}" for size in SIZES_PX]
        ms = statistics.median(each.ms)
        print(f"| {each.side} | {ms:.0f} | {each.false} | {' | '.join(shares)} |")
    for path in asked.also:
        picture = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB)
        for each in measured:
            found = each.detect(picture)
            print(f"{path.name}, tile={each.side}: {each.ms[-1]:.0f} ms, {len(found)} false")


if __name__ == "__main__":
    main()
