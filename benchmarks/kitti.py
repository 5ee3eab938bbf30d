"""Speed of converting KITTI to a bag: `python benchmarks/kitti.py DRIVE [--kitti2bag CMD]`.

DRIVE is a drive's folder with calibration beside it; its frames are repeated. The bound is reading
the files, decoding the images and writing as many bytes, with a thread for each core. CMD is what
runs kitti2bag 1.5, such as "python kitti2bag"; without it that column is omitted.
"""

import argparse
import os
import shlex
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np

PERIOD_NS = 103_600_000
AHEAD = 8


def repeat_drive(drive: Path, folder: Path, frames: int) -> Path:
    """A drive of so many frames, made of links to those of another."""
    target = folder / drive.parent.name / drive.name
    target.mkdir(parents=True)
    for path in drive.parent.glob("calib_*.txt"):
        (target.parent / path.name).symlink_to(path)
    for part in drive.iterdir():
        (target / part.name / "data").mkdir(parents=True)
        files = sorted((part / "data").iterdir())
        for number in range(frames):
            file = files[number % len(files)]
            (target / part.name / "data" / f"{number:010d}{file.suffix}").symlink_to(file)
        for path in part.glob("timestamps*.txt"):
            first = np.datetime64(path.read_text().split("\n")[0], "ns")
            stamps = first + np.arange(frames) * np.timedelta64(PERIOD_NS, "ns")
            lines = [f"{str(stamp).replace('T', ' ')}\n" for stamp in stamps]
            (target / part.name / path.name).write_text("".join(lines))
    return target


def run_bound(drive: Path, target: Path) -> None:
    """Read, decode and write, and nothing more."""

    def load(path: Path) -> memoryview:
        data = np.frombuffer(path.read_bytes(), np.uint8)
        if path.suffix != ".png":
            return data.data
        color = path.parent.parent.name in ("image_02", "image_03")
        flag = cv2.IMREAD_COLOR if color else cv2.IMREAD_GRAYSCALE
        return cv2.imdecode(data, flag).reshape(-1).data

    files = sorted(drive.glob("*/data/*"), key=lambda path: path.stem)
    with target.open("wb") as out, ThreadPoolExecutor(os.cpu_count()) as pool:
        waiting: deque = deque()
        for path in files:
            waiting.append(pool.submit(load, path))
            if len(waiting) > AHEAD:
                out.write(waiting.popleft().result())
        while waiting:
            out.write(waiting.popleft().result())


def run_convert(drive: Path, target: Path) -> None:
    """Our own command, from its start to its end."""
    command = [sys.executable, "-m", "ros_visualise", "convert", str(drive), str(target)]
    command += ["--compression", "none"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def run_kitti2bag(command: str, drive: Path, target: Path) -> None:
    """The other's command, which chooses the name itself."""
    date, number = drive.parent.name, drive.name.split("_")[-2]
    subprocess.run(
        [*shlex.split(command), "raw_synced", str(drive.parents[1]), "-t", date, "-r", number],
        cwd=target.parent,
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def seconds(run: Callable[[], None]) -> float:
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("drive", type=Path)
    parser.add_argument("--kitti2bag", metavar="CMD")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    times: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        drive = repeat_drive(args.drive.absolute(), folder / "kitti", args.frames)
        runs = {"bound": run_bound, "convert": run_convert}
        if args.kitti2bag:
            runs["kitti2bag"] = lambda drive, out: run_kitti2bag(args.kitti2bag, drive, out)
        for _ in range(args.rounds):
            for title, run in runs.items():
                out = folder / "out"
                out.mkdir()
                took = seconds(lambda run=run, out=out: run(drive, out / "drive.bag"))
                times.setdefault(title, []).append(took)
                shutil.rmtree(out)
    print("| what | s | frames per second | times as fast as it |\n|---|---|---|---|")
    for title, took in times.items():
        ratio = statistics.median(a / b for a, b in zip(took, times["convert"], strict=True))
        middle = statistics.median(took)
        print(f"| {title} | {middle:.2f} | {args.frames / middle:.1f} | {ratio:.2f} |")


if __name__ == "__main__":
    main()
