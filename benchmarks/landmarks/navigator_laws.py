"""Consistency of the navigator where the world differs from its model, over many flights.

    python benchmarks/landmarks/navigator_laws.py [--seeds 30] [--only clutter]

The worlds are those of `tests/estimation/world.py`, which shares no formula with the package; the
navigator is judged by its published poses alone. The NEES is the squared error by its covariance,
over the size of the error: 1 on average where that is honest. A pose is falsely certain if its
position is off by more than 5 sigma.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "estimation"))
from driven import drive, params
from world import HERE, ORIGIN, Sensor, World, along, map_text, square, surveyed, tags_on_ground

AT_ORIGIN = ", ".join(map(str, ORIGIN))
GRID = tags_on_ground([(x, y, -5) for x in range(0, 13, 4) for y in range(0, 13, 4)])
ROW = tags_on_ground([(20 * n, 0.3, -5) for n in range(12)], side=0.6)
PAIR = tags_on_ground([(3, 0.5, -5), (4.5, -1, -5)])
ALL = {"imu": Sensor(50, priority=-1), "gps": Sensor(2, priority=-1)}
LATE = {
    "images": Sensor(5, latency_s=0.1, jitter_s=0.2, priority=-1),
    "gps": Sensor(2, latency_s=0.1, jitter_s=0.2, priority=-1),
    "imu": Sensor(50, jitter_s=0.02, priority=-1),
}
ROUND, AHEAD = along(*square(laps=4)), along((0, 0, 0), (300, 0, 0), speed=6.0)
SLOW = along((0, 0, 0), (60, 0, 0), speed=1.5)
WITH_GPS = {"gps_origin": AT_ORIGIN, "gps_slow": 0.5}

# name: the world, its tags' survey in m and rad (None: a new map), parameters, from and to in s
CASES = {
    "as the model": ({"path": ROUND, "tags": GRID, **ALL}, None, WITH_GPS, (5, 30)),
    "late, in any order": ({"path": ROUND, "tags": GRID, **LATE}, None, WITH_GPS, (5, 30)),
    "known map": ({"path": ROUND, "tags": GRID, **ALL}, (0.05, 0.02), WITH_GPS, (5, 30)),
    "two uncertain tags": ({"path": SLOW, "tags": PAIR}, (0.2, 0.02), {}, (3, 3.6)),
    "scale changes 2%": (
        {"path": AHEAD, "tags": ROW, "scales": [(0, 18, 0.01), (18, 99, -0.01)], "walk": 0.01},
        (0.01, 0.01),
        {"odom_noise": 0.01},
        (18, 32),
    ),
    "odometry stalls": (
        {"path": ROUND, "tags": GRID, "slips": [(10, 10.6, 0.0), (15, 15.6, 0.0)], **ALL},
        (0.01, 0.01),
        WITH_GPS,
        (5, 25),
    ),
    "odometry slips": (
        {"path": ROUND, "tags": GRID, "slips": [(10, 12, 0.5), (15, 16, 0.7)], **ALL},
        (0.01, 0.01),
        WITH_GPS,
        (5, 25),
    ),
    "clutter": (
        {"path": ROUND, "tags": GRID, "clutter": 0.3, "images": Sensor(10, priority=1)},
        None,
        {},
        (5, 50),
    ),
}


def flown(name: str, seed: int, folder: Path):
    """The flight of a seed: its world, its run, and the seconds that it took."""
    values, survey, given, (_, end) = CASES[name]
    world = World(**values, seed=seed)
    settings = {"level_sigma": 0.2, **given}
    if survey:
        found, covariance = surveyed(world.tags, *survey, seed)
        path = folder / "map.yaml"
        path.write_text(map_text(found, covariance))
        settings |= {"map": str(path), "mode": "frozen"}
    events = world.events(end)
    start = time.perf_counter()
    run = drive(events, params(**settings), start=HERE)
    return world, run, time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--only", choices=CASES, action="append")
    options = parser.parse_args()
    print("| world | NEES | worst flight | falsely certain | located | landmarks | losses | s |")
    print("|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name in options.only or CASES:
            rows = []
            for seed in range(options.seeds):
                world, run, seconds = flown(name, seed, Path(folder))
                first, last = CASES[name][3]
                nees = run.nees(world, first, last, size=6)
                rows.append(
                    (
                        nees.mean() / 6 if len(nees) else np.nan,
                        run.falsely_certain(world, first, last),
                        run.located(first, last),
                        run.counts[-1][2] if run.counts else 0,
                        run.counted("loss"),
                        seconds,
                    )
                )
            mean = np.nanmean(np.array(rows, float), axis=0)
            worst = np.nanmax([row[0] for row in rows])
            print(
                f"| {name} | {mean[0]:.2f} | {worst:.1f} | {mean[1]:.1%} | {mean[2]:.0%}"
                f" | {mean[3]:.0f} of {len(world.tags)} | {mean[4]:.1f} | {mean[5]:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
