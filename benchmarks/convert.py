"""Speed of converting recordings, compared with rosbags-convert and the mcap library alone.

python benchmarks/convert.py [--messages 100000] [--images 300] [--kitti DRIVE]

Wall and CPU seconds of whole processes, the peak of their resident set, the ratio of our rate to
theirs, and that of our file's size to theirs. DRIVE is a folder as 2011_09_26 of KITTI's raw data;
the bound reads its files, decodes the images and writes as many bytes as the bag has.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Header, Image, Imu
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder

TOPICS = {
    "/imu/data": TopicType("sensor_msgs/msg/Imu"),
    "/image_raw": TopicType("sensor_msgs/msg/Image"),
}

MCAP_ALONE = """
import sys
from pathlib import Path
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader

source, profile, language, encoding, compression, target = sys.argv[1:]
with AnyReader([Path(source)]) as reader, open(target, "wb") as file:
    writer = Writer(file, compression=CompressionType[compression])
    writer.start(profile)
    channels = {}
    for c in reader.connections:
        schema = writer.register_schema(c.msgtype, language, c.msgdef.data.encode())
        channels[c.id, c.topic] = writer.register_channel(c.topic, encoding, schema)
    for c, stamp, data in reader.messages():
        writer.add_message(channels[c.id, c.topic], stamp, data, stamp)
    writer.finish()
"""

KITTI_BOUND = """
import sys
from pathlib import Path
import cv2

with open(sys.argv[2], "wb") as file:
    for path in sorted(Path(sys.argv[1]).rglob("*.*")):
        if path.suffix == ".png":
            file.write(cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
        elif path.suffix == ".bin":
            file.write(path.read_bytes())
"""


class Cost(NamedTuple):
    wall_s: float
    cpu_s: float
    peak_mib: float
    size: int


def run(command: Sequence[str]) -> Cost:
    """What a process takes; the best of three, against what else the machine does."""
    return min(map(_run_once, [command] * 3), key=lambda cost: cost.cpu_s)


def _run_once(command: Sequence[str]) -> Cost:
    target = Path(command[-1])
    shutil.rmtree(target, ignore_errors=True)
    target.unlink(missing_ok=True)
    watch = (
        "import resource, subprocess, sys\n"
        "subprocess.run(sys.argv[1:], check=True, stdout=2, stderr=subprocess.DEVNULL)\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)"
    )
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", watch, *command],
        check=True, text=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    wall_s = time.perf_counter() - start
    cpu_s, peak_mib = map(float, done.stdout.split())
    files = target.iterdir() if target.is_dir() else [target]
    return Cost(wall_s, cpu_s, peak_mib, sum(file.stat().st_size for file in files))


def make_bag(path: Path, messages: int, images: int) -> Path:
    """A bag of small messages, or of images of 1.4 MB as KITTI's in colour."""
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 255, (375, 1242, 3), np.uint8)
    still = np.array([0, 0, 0, 1.0])
    with open_recorder(str(path), TOPICS, live=False) as recorder:
        for number in range(messages):
            header = Header(10**9 + number * 10**6, "imu")
            recorder.write("/imu/data", Imu(still, np.zeros(3), rng.random(3), header=header))
        for number in range(images):
            shown = np.roll(pixels, number, axis=1)
            recorder.write("/image_raw", Image(shown, "bgr8", Header(10**9 + number * 10**8)))
    return path


def repeat_drive(drive: Path, folder: Path, times: int) -> Path:
    """A drive of one's own that is so many times as long, without time stamps."""
    for file in drive.glob("*.txt"):
        shutil.copy(file, folder)
    (source,) = (path for path in drive.iterdir() if path.is_dir())
    for path in sorted(source.glob("*/data/*")):
        frames = len(list(path.parent.iterdir()))
        target = folder / path.relative_to(drive)
        target.parent.mkdir(parents=True, exist_ok=True)
        for turn in range(times):
            number = int(path.stem) + turn * frames
            (target.parent / f"{number:010d}{path.suffix}").symlink_to(path.resolve())
    return folder


def compare(title: str, ours: Sequence[str], theirs: Sequence[str], name: str) -> None:
    """Print a row."""
    mine, other = run(ours), run(theirs)
    print(
        f"| {title} | {mine.wall_s:.2f} | {mine.cpu_s:.2f} | {mine.peak_mib:.0f} | {name}"
        f" | {other.wall_s:.2f} | {other.cpu_s:.2f} | {other.peak_mib:.0f}"
        f" | {other.wall_s / mine.wall_s:.2f} | {other.cpu_s / mine.cpu_s:.2f}"
        f" | {mine.size / other.size:.2f} |",
        flush=True,
    )


def compare_copies(title: str, bag: Path, folder: Path) -> None:
    """Print two rows: a bag and an .mcap whose messages keep their bytes.

    Both compress alike: small messages by ZSTD, which the mcap library takes if nobody says, and
    images by LZ4.
    """
    compression = "LZ4" if "images" in title else "ZSTD"
    ours, theirs = str(folder / "ours.mcap"), str(folder / "theirs")
    convert, alone = [sys.executable, "-m", "ros_visualise", "convert"], [sys.executable, "-c"]
    same = [*convert, str(bag), "--profile", "ros1", ours]
    loop = [*alone, MCAP_ALONE, str(bag), "ros1", "ros1msg", "ros1", compression, theirs]
    compare(f"{title} as they are, a bag", same, loop, "rosbags, mcap")
    mcap = folder / "source.mcap"
    subprocess.run(
        [*convert, "--overwrite", str(bag), str(mcap)], check=True, stderr=subprocess.DEVNULL
    )
    loop = [*alone, MCAP_ALONE, str(mcap), "ros2", "ros2msg", "cdr", compression, theirs]
    compare(f"{title} as they are, an .mcap", [*convert, str(mcap), ours], loop, "rosbags, mcap")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--messages", type=int, default=100_000)
    parser.add_argument("--images", type=int, default=300)
    parser.add_argument("--kitti", type=Path, metavar="DRIVE")
    args = parser.parse_args()
    convert = [sys.executable, "-m", "ros_visualise", "convert"]
    print("| | s | CPU s | MiB | beside | s | CPU s | MiB | rate | by CPU | size |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bags = {
            f"{args.messages} messages": make_bag(folder / "small.bag", args.messages, 0),
            f"{args.images} images": make_bag(folder / "large.bag", 0, args.images),
        }
        ours, theirs = str(folder / "ours.mcap"), str(folder / "theirs")
        for title, bag in bags.items():
            rosbags = ["rosbags-convert", "--dst-storage", "mcap", "--src", str(bag), "--dst"]
            plain = ["--compression", "none", ours]
            compare(
                f"{title} to ROS 2", [*convert, str(bag), *plain], [*rosbags, theirs], "rosbags"
            )
            compare_copies(title, bag, folder)
        if args.kitti:
            drive = folder / "drive"
            drive.mkdir()
            repeat_drive(args.kitti, drive, 20)
            bound = [sys.executable, "-c", KITTI_BOUND, str(drive), theirs]
            bag = str(folder / "kitti.bag")
            compare("KITTI to a bag", [*convert, str(drive), bag], bound, "the bound")


if __name__ == "__main__":
    main()
