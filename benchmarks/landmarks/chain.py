"""Load test of detection, localization and navigation with a camera of 640x480 at 30 per second.

    python benchmarks/landmarks/chain.py [--seconds 20] [--cores 2]

A simulated flight over the field is recorded once, as fast as that goes. Then it is played in real
time, as a robot would send it, through tag_detector and landmark_navigator with odometry at 50 and
an IMU at 100 per second, on so many cores, with all else that playing takes.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from ros_visualise.graph.landmarks import tags_of_world

RUN = (sys.executable, "-m", "ros_visualise")
TOPICS = ("/image_raw", "/camera_info", "/odom", "/imu/data", "/tf", "/tf_static")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--recording", help="keep it here, and take it if it is there already")
    args = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(args.recording or f"{folder}/flight.mcap")
        if not recording.exists():
            record(recording, args.seconds)
        print_rows(play(recording, args.cores))


def record(path: Path, seconds: float) -> None:
    """A flight with 30 images per second, all its topics but what is not needed."""
    whole = path.with_suffix(".all.mcap")
    settings = ("--set", "quadrotor.camera_rate=30", "--duration", str(seconds))
    quiet = ("--rate", "0", "--view", "none")
    run("sim", "quadrotor", "--mission", "default", *settings, *quiet, "--record", str(whole))
    run("convert", str(whole), str(path), "--topics", *TOPICS)
    whole.unlink()


def play(path: Path, cores: int) -> dict[str, Any]:
    """The report of a run in real time."""
    os.sched_setaffinity(0, set(list(os.sched_getaffinity(0))[:cores]))
    chain = ("--navigate", "--set", f"tag_detector.tags={tags_of_world('field')}")
    told = run("bag", str(path), *chain, "--view", "none", "--json")
    found: dict[str, Any] = json.loads(told)
    return found


def run(*args: str) -> str:
    done = subprocess.run([*RUN, *args], capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    return done.stdout


def print_rows(report: dict[str, Any]) -> None:
    print("| node | messages | left out | median ms | p99 ms |")
    print("|---|---|---|---|---|")
    for name, node in report["nodes"].items():
        if node["received"] and node["p50_ms"] is not None:
            lost = sum(node["dropped"].values())
            times = node["p50_ms"], node["p99_ms"]
            print(f"| {name} | {node['received']} | {lost} | {times[0]:.1f} | {times[1]:.1f} |")


if __name__ == "__main__":
    main()
