"""A lidar's scan by our own rays and by MuJoCo's: `python benchmarks/lidar.py`.

CPU time of one scan from places all over each world, the median; the ratio says how many times as
long ``mj_multiRay`` takes. It is given the same rays and leaves out the robot, as ours do.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ros_visualise.simulation.attitude import from_yaw, rows
from ros_visualise.simulation.engine import load_mujoco
from ros_visualise.simulation.robots.husky.settings import HuskyParams
from ros_visualise.simulation.sensors.lidar import Lidar
from ros_visualise.simulation.simulator import Simulation
from ros_visualise.simulation.worlds import WORLDS

LAYOUTS = ((16, 900), (64, 1024))
SCANS = 40
_WORLD_ONLY = np.array([1, 0, 0, 0, 0, 0], np.uint8)  # groups: the robot's geoms are in others


def measure(scan: Callable[[np.ndarray, np.ndarray], Any]) -> float:
    """Milliseconds of a scan."""
    random, times = np.random.default_rng(0), []
    for _ in range(SCANS):
        place = np.array([*random.uniform(-6, 6, 2), 0.6])
        R = np.array(rows(from_yaw(random.uniform(-3, 3))))
        start = time.process_time()
        scan(place, R)
        times.append(time.process_time() - start)
    return 1e3 * statistics.median(times)


def mujocos(simulation: Simulation, lidar: Lidar) -> Callable[[np.ndarray, np.ndarray], None]:
    """The same scan by ``mj_multiRay``."""
    model, data, mujoco = simulation._model, simulation._data, load_mujoco()
    rays = lidar._rays.astype(np.float64)
    count = rays.shape[1]
    geoms, ranges = np.empty(count, np.int32), np.empty(count)

    def scan(place: np.ndarray, R: np.ndarray) -> None:
        turned = np.ascontiguousarray((R @ rays).T).ravel()
        mujoco.mj_multiRay(
            model, data, place, turned, _WORLD_ONLY, 1, -1, geoms, ranges, None, count, 100.0
        )

    return scan


def main() -> None:
    print("| world | rays | ours, ms | mj_multiRay, ms | ratio |\n|---|---|---|---|---|")
    for world in WORLDS.builtin:
        simulation = Simulation("husky", world, settings=replace(HuskyParams(), camera=False))
        for rings, columns in LAYOUTS:
            params = replace(HuskyParams(), lidar_rings=rings, lidar_columns=columns)
            lidar = Lidar(params, 0, simulation._model, simulation._data)
            own, other = measure(lidar.cast), measure(mujocos(simulation, lidar))
            print(f"| {world} | {rings}x{columns} | {own:.2f} | {other:.2f} | {other / own:.0f} |")


if __name__ == "__main__":
    main()
