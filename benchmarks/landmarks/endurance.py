"""An hour of flight of the navigator's node: states, memory and time of a step, each five minutes.

    python benchmarks/landmarks/endurance.py [--minutes 60] [--tags 49] [--clutter 0.3]

The world is that of `tests/estimation/world.py`, nothing is rendered: images at 10 Hz, of which 30%
have a false tag, odometry at 50 Hz; laps over tags on the ground, whose map is built.
"""

from __future__ import annotations

import argparse
import heapq
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
from world import T0, Event, S, Sensor, World, along, frame, mounting, square, tags_on_ground

from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes.landmark_navigator import LandmarkNavigator

EACH_S = 300
SPACING = 2.8


def messages(world: World, until_s: float):
    """All messages in the order of their times, made one by one."""

    def of(number, port, sensor, maker):
        random, times = np.random.default_rng([world.seed, number]), sensor.times(until_s)
        for t, make in zip(times, maker(times, random), strict=True):
            yield Event(t, sensor.priority, port, make(round((t + T0) * S)))

    odometry = of(0, "odometry", world.odometry, world._odometry)
    images = of(1, "detections", world.images, world._images)
    return heapq.merge(odometry, images, key=lambda one: one[:2])


def rss_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def print_row(end_s: float, took_s: dict[str, list[float]], node: LandmarkNavigator) -> None:
    navigator = node._navigator
    state, landmark_map = navigator.belief.state, navigator.map
    resting = len(state.resting.left) if state.resting else 0
    used = len(landmark_map.used)
    ms = [np.percentile(took_s[port], q) * 1e3 for port in took_s for q in (50, 99)]
    cells = [f"{end_s / 60:.0f}", str(6 * resting + len(state.P)), f"{used}"]
    cells += [
        str(len(landmark_map.landmarks) - used),
        f"{rss_mb():.0f}",
        *(f"{one:.2f}" for one in ms),
    ]
    print("| " + " | ".join(cells) + " |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--tags", type=int, default=49)
    parser.add_argument("--clutter", type=float, default=0.3)
    options = parser.parse_args()
    count = round(options.tags**0.5)
    side, until_s = SPACING * (count - 1), 60 * options.minutes
    laps = int(3 * until_s / (4 * side)) + 2
    places = [(SPACING * x, SPACING * y, -8) for x in range(count) for y in range(count)]
    tags = tags_on_ground(places)
    path = along(*square(side, laps=laps))
    images = Sensor(10, priority=1)
    world = World(path, tags, odometry=Sensor(50), images=images, clutter=options.clutter)
    settings = params()
    node, frames = LandmarkNavigator(settings), FrameTree()
    frames.add(frame("map", "odom_start", world.start()), static=True)
    frames.add(mounting(), static=True)
    took_s, next_s = defaultdict(list), EACH_S
    print("| minutes | states | landmarks | pending | MB | odometry ms | p99 | image ms | p99 |")
    print("|---|---|---|---|---|---|---|---|---|")
    for event in messages(world, until_s):
        if event.arrival_s >= next_s:
            print_row(next_s, took_s, node)
            took_s.clear()
            next_s += EACH_S
        start_s = time.thread_time()
        node.step(settings, **{event.port: event.message}, frames=frames)
        took_s[event.port].append(time.thread_time() - start_s)


if __name__ == "__main__":
    main()
