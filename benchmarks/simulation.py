"""Speed of simulated robots relative to real time: `python benchmarks/simulation.py`.

Each robot in each world on its default mission, with all sensors but images (the quadrotor with and
without the lidar, which it leaves off by default) and with images of 640x480 at 10 per second too,
also of the profiles `realistic` and `hard`.
By the wall clock and by the process's CPU time, which is fairer on a machine that is shared: the
median of windows of a simulated second. *Dearest* is what takes most of the CPU time.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

from ros_visualise.core.errors import OpenError
from ros_visualise.core.params import specs, update
from ros_visualise.simulation.engine import load_mujoco
from ros_visualise.simulation.profiles import Profile, settings_of
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.simulation.settings import RobotParams
from ros_visualise.simulation.simulator import Simulation
from ros_visualise.simulation.worlds import WORLDS

WARM_UP_S = 2


def settings(robot: str) -> dict[str, RobotParams]:
    """What is measured, by its title."""
    blind = replace(ROBOTS.find(robot).params(), camera=False)
    sets = {"all but images": blind, "and images": replace(blind, camera=True)}
    known = {spec.name for spec in specs(blind)}
    for profile in (Profile.REALISTIC, Profile.HARD):
        errors = {name: value for name, value in settings_of(profile).items() if name in known}
        sets[f"and images, {profile.value}"] = update(blind, {**errors, "camera": True})
    if not blind.lidar:
        sets["and the lidar, no images"] = replace(blind, lidar=True)
    return sets


def measure(simulation: Simulation, seconds: int) -> tuple[float, float]:
    """Wall and CPU seconds of a simulated one."""
    times = []
    end_ns = WARM_UP_S * 10**9
    for stamp_ns, _, _ in simulation.run():
        if stamp_ns >= end_ns:
            times.append((time.perf_counter(), time.process_time()))
            end_ns += 10**9
            if len(times) > seconds:
                break
    windows = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(times)]
    walls, cpus = zip(*windows, strict=True)
    return statistics.median(walls), statistics.median(cpus)


def find_shares(simulation: Simulation, seconds: int) -> Counter[str]:
    """CPU time by what it went to; taking it slows a run, so this is one of its own."""
    spent: Counter[str] = Counter()
    mujoco = load_mujoco()
    step = mujoco.mj_step
    mujoco.mj_step = timed("physics", step, spent)
    robot = simulation._robot
    robot.control = timed("control", robot.control, spent)
    for stream in simulation._streams:
        stream.measure = timed(stream.output, stream.measure, spent)
    measure(simulation, seconds)
    mujoco.mj_step = step
    return spent


def timed(title: str, function: Callable[..., Any], spent: Counter[str]) -> Callable[..., Any]:
    """The function, its CPU time added up under the title."""

    def call(*arguments: Any) -> Any:
        start = time.process_time()
        result = function(*arguments)
        spent[title] += time.process_time() - start
        return result

    return call


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=int, default=20, help="simulated (%(default)s)")
    parser.add_argument("--robot", nargs="*", default=[*ROBOTS.builtin])
    parser.add_argument("--world", nargs="*", default=[*WORLDS.builtin])
    parser.add_argument("--images", action=argparse.BooleanOptionalAction, default=True)
    args = parser.parse_args()
    print("| robot | world | sensors | by the wall | by CPU | dearest |\n|---|---|---|---|---|---|")
    for robot in args.robot:
        for world in args.world:
            for title, chosen in settings(robot).items():
                if args.images or not chosen.camera:
                    print_row(robot, world, title, chosen, args.seconds)


def print_row(robot: str, world: str, title: str, chosen: RobotParams, seconds: int) -> None:
    try:
        wall_s, cpu_s = measure(Simulation(robot, world, 0, "default", chosen), seconds)
    except OpenError as error:
        print(f"| {robot} | {world} | {title} | {error} | | |")
        return
    spent = find_shares(Simulation(robot, world, 0, "default", chosen), 5)
    shares = (f"{name} {part / spent.total():.0%}" for name, part in spent.most_common(2))
    print(
        f"| {robot} | {world} | {title} | {1 / wall_s:.1f} | {1 / cpu_s:.1f} "
        f"| {', '.join(shares)} |",
        flush=True,
    )


if __name__ == "__main__":
    main()
