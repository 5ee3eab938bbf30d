"""Time of a step of the navigator's node over many tags, whose map is built.

    python benchmarks/landmarks/step_times.py [--tags 500] [--seconds 230] [--runs 3]

The world is that of `tests/estimation/world.py`, nothing is rendered: images at 10 Hz, odometry at
50 Hz, lanes over tags on the ground. CPU time of one thread: of each step the least of several runs
of the same flight, as other processes on the machine lengthen it.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import defaultdict
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "estimation"))
from driven import params
from world import Event, Sensor, World, along, frame, mounting, tags_on_ground

from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes.landmark_navigator import LandmarkNavigator

SPACING, LANE = 2.8, 6.0


def world_of(count: int) -> World:
    """Tags scattered over a square, and lanes over it."""
    random = np.random.default_rng(0)
    side = SPACING * np.ceil(count**0.5)
    grid = np.arange(0, side, SPACING)
    places = [(x, y, -8) for x in grid for y in grid][:count]
    places = [(*np.add(place[:2], random.uniform(-0.8, 0.8, 2)), place[2]) for place in places]
    lanes = [((0, y, 0), (side, y, 0)) for y in np.arange(2, side, LANE)]
    points = [point for n, lane in enumerate(lanes) for point in lane[:: 1 if n % 2 == 0 else -1]]
    images = Sensor(10, priority=1)
    return World(along(*points), tags_on_ground(places), odometry=Sensor(50), images=images)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tags", type=int, default=500)
    parser.add_argument("--seconds", type=float, default=230)
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    world = world_of(options.tags)
    events = world.events(options.seconds)
    runs = [flown(world, events) for _ in range(options.runs)]
    print("| step | number | median ms | p90 | p99 | at most |")
    print("|---|---|---|---|---|---|")
    for step in sorted(runs[0]):
        least = np.min([one[step] for one in runs], axis=0)
        cells = [f"{np.percentile(least, q) * 1e3:.2f}" for q in (50, 90, 99, 100)]
        print(f"| {step} | {len(least)} | " + " | ".join(cells) + " |")


def flown(world: World, events: list[Event]) -> dict[str, list[float]]:
    """Seconds of each step, by its message."""
    settings, frames = params(), FrameTree()
    frames.add(frame("map", "odom_start", world.start()), static=True)
    frames.add(mounting(), static=True)
    node, took_s = LandmarkNavigator(settings), defaultdict(list)
    for event in events:
        start_s = time.thread_time()
        answer = node.step(settings, **{event.port: event.message}, frames=frames)
        spent_s = time.thread_time() - start_s
        due = ", markers due" if answer and "markers" in answer else ""
        took_s[event.port + due].append(spent_s)
    print(node.report(), flush=True)
    return took_s


if __name__ == "__main__":
    main()
