"""Our transport and nodes on a ROS 2 graph beside stock rclpy, on one machine in one run.

    python benchmarks/ros2/run.py [--quick] [--sections transport chain] [--rate 30] ...

Run it with an interpreter that has rclpy and this package, in a sourced workspace.
"""

import argparse
import contextlib
import json
import os
import random
import signal
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from ros_visualise.running.executables import command_of
from ros_visualise.runtime.ros2.session import configure

HERE = Path(__file__).parent
ENDS = HERE / "ends.py"
LOCAL = HERE.parent / "ros1" / "local.py"
SIZES = {"480p": "640x480", "1080p": "1920x1080", "4K": "3840x2160"}
_CHAIN = "1080p"
_END_S = 5.0

Command = list[str | Path]
Figures = Mapping[str, float]


class Bench:
    """What every section is given; a graph of its own, on this machine alone."""

    def __init__(self, args: argparse.Namespace, scratch: Path) -> None:
        self.args = args
        self.scratch = scratch
        os.environ["ROS_DOMAIN_ID"] = str(random.randrange(1, 100))
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        os.environ["ROS_VERSION"] = "2"
        configure()  # for stock rclpy too, which would lose most of the large images without it

    def window(self) -> Command:
        return ["--seconds", str(self.args.seconds), "--warmup", str(self.args.warmup)]

    def hear(self, kind: str, topic: str, *commands: Command) -> Figures:
        """What a subscriber tells of a topic while these processes run."""
        with self._running(commands):
            return _told([sys.executable, ENDS, "subscribe", kind, topic, *self.window()])

    def rounds_of(
        self, candidates: Mapping[str, tuple[str, str, list[Command]]]
    ) -> dict[str, Figures]:
        """Medians of several rounds, in which the candidates take turns."""
        rounds = [
            {name: self.hear(kind, topic, *run) for name, (kind, topic, run) in candidates.items()}
            for _ in range(self.args.rounds)
        ]
        return {name: _medians([one[name] for one in rounds]) for name in candidates}

    @contextlib.contextmanager
    def _running(self, commands: Sequence[Command]) -> Iterator[None]:
        log = (self.scratch / "log").open("ab")
        started = [subprocess.Popen(command, stdout=log, stderr=log) for command in commands]
        try:
            yield
            for process in started:
                if process.poll() is not None:
                    print(f"ended early ({process.returncode}): {process.args}; see {log.name}")
        finally:
            for process in started:
                process.send_signal(signal.SIGINT)
            for process in started:
                try:
                    process.wait(_END_S)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
            log.close()


def transport(bench: Bench) -> None:
    """Images of noise from one process to another."""
    rate = bench.args.rate
    _header(f"bgr8 images from one process to another, {rate:g} a second", "size", "from and to")
    for size in bench.args.sizes:
        measured = bench.rounds_of(
            {
                f"{sender} to {taker}": (taker, "/image_raw", [_sender(sender, size, rate)])
                for sender in ("rclpy", "ours", "plain")
                for taker in ("rclpy", "ours")
            }
        )
        for name, one in measured.items():
            _row(size, name, one, measured["rclpy to rclpy"])


def chain(bench: Bench) -> None:
    """streamer -> fps_control -> filters -> edge_detector, as old as the streamer's stamps say."""
    rate = bench.args.rate
    video = _video(bench.scratch, rate)
    played = {"path": video, "loop": "true"}
    separate = [_node("streamer", **played), *(_node(name) for name in ("fps_control", "filters"))]
    separate.append(_node("edge_detector"))
    inside = {"source": "streamer", **{f"streamer.{key}": v for key, v in played.items()}}
    _header(f"A video of {_CHAIN} at {rate:g} fps, to its edges", "size", "chain")
    measured = bench.rounds_of(
        {
            "separate nodes": ("ours", "/edges", separate),
            "pipeline": ("ours", "/edges", [_node("pipeline", **inside)]),
        }
    )
    for name, one in measured.items():
        _row(_CHAIN, name, one, measured["separate nodes"])


def throughput(bench: Bench) -> None:
    """The same in one process, as fast as it goes, beside the runtime without ROS.

    Its edges are made for whoever listens: once to their calibrations alone, which are small, so
    that what ROS costs around the pipeline is told from what it costs to send an image.
    """
    video = _video(bench.scratch, bench.args.rate)
    inside = {"source": "streamer", "streamer.path": video, "streamer.loop": "true"}
    inside |= {"streamer.rate": "0.0", "fps_control.enabled": "false"}
    inside["streamer.camera_info_url"] = _calibration(bench.scratch)
    pipeline = _node("pipeline", **inside)
    rounds = [
        (
            _told([sys.executable, LOCAL, video, *bench.window()]),
            bench.hear("count", "/edges/camera_info", pipeline),
            bench.hear("ours", "/edges", pipeline),
        )
        for _ in range(bench.args.rounds)
    ]
    local, made, sent = (_medians(list(column)) for column in zip(*rounds, strict=True))
    _header("As fast as it goes", "size", "chain")
    _row(_CHAIN, "local runtime, no ROS", {"fps": local["fps"]}, local)
    _row(_CHAIN, "pipeline, edges made", {"fps": made["fps"]}, local)
    _row(_CHAIN, "pipeline, edges sent", {"fps": sent["fps"]}, local)


SECTIONS = {"transport": transport, "chain": chain, "throughput": throughput}


def _sender(kind: str, size: str, rate: float) -> Command:
    return [sys.executable, ENDS, "publish", kind, SIZES[size], "--rate", str(rate)]


def _node(name: str, **given: object) -> Command:
    told = [part for key, value in given.items() for part in ("-p", f"{key}:={value}")]
    return [*command_of(name), "--ros-args", *told]


def _video(folder: Path, rate: float) -> Path:
    """Three seconds of FFmpeg's test scene."""
    path = folder / "scene.mp4"
    scene = f"testsrc2=size={SIZES[_CHAIN]}:rate={rate}:duration=3"
    coded = ["-c:v", "libx264", "-preset", "superfast", "-pix_fmt", "yuv420p"]
    command = ["ffmpeg", "-nostdin", "-y", "-loglevel", "error", "-f", "lavfi", "-i", scene]
    subprocess.run([*command, *coded, str(path)], check=True)
    return path


def _calibration(folder: Path) -> Path:
    """That of a camera without distortion."""
    width, height = map(int, SIZES[_CHAIN].split("x"))
    path = folder / "camera.yaml"
    camera = [width, 0, width / 2, 0, width, height / 2, 0, 0, 1]
    projection = [*camera[:3], 0, *camera[3:6], 0, *camera[6:], 0]
    path.write_text(
        f"image_width: {width}\nimage_height: {height}\ncamera_name: scene\n"
        f"camera_matrix: {{rows: 3, cols: 3, data: {camera}}}\n"
        "distortion_model: plumb_bob\n"
        "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n"
        "rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}\n"
        f"projection_matrix: {{rows: 3, cols: 4, data: {projection}}}\n"
    )
    return path


def _told(command: Command) -> Figures:
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True, timeout=180)
    figures: Figures = json.loads(done.stdout.splitlines()[-1])
    return figures


def _medians(rounds: Sequence[Figures]) -> Figures:
    return {
        name: statistics.median(one.get(name, float("nan")) for one in rounds) for name in rounds[0]
    }


def _header(title: str, *columns: str) -> None:
    names = [*columns, "fps", "p50 ms", "p99 ms", "fps of the first", "p50 of the first"]
    print(f"\n## {title}\n\n| {' | '.join(names)} |\n{'|---' * len(names)}|", flush=True)


def _row(size: str, name: str, one: Figures, first: Figures) -> None:
    if not one["fps"]:
        print(f"| {size} | {name} | nothing came | - | - | - | - |", flush=True)
        return
    ages = [f"{one[key]:.1f}" if key in one else "-" for key in ("p50_ms", "p99_ms")]
    of = [
        f"{one[key] / first[key]:.2f}" if one.get(key) and first.get(key) else "-"
        for key in ("fps", "p50_ms")
    ]
    print(f"| {size} | {name} | {one['fps']:.1f} | {' | '.join([*ages, *of])} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    add = parser.add_argument
    add("--sizes", nargs="+", choices=SIZES, default=list(SIZES))
    add("--sections", nargs="+", choices=SECTIONS, default=list(SECTIONS))
    add("--rate", type=float, default=30.0, help="images a second (%(default)s)")
    add("--rounds", type=int, default=1, help="medians of so many (%(default)s)")
    add("--seconds", type=float, default=8.0, help="that one figure is measured (%(default)s)")
    add("--warmup", type=float, default=3.0, help="seconds before that (%(default)s)")
    add("--quick", action="store_true", help="short windows: whether it runs, not how fast")
    args = parser.parse_args()
    if args.quick:
        args.seconds, args.warmup = 2.0, 1.0
    with tempfile.TemporaryDirectory(prefix="ros_visualise_") as folder:
        bench = Bench(args, Path(folder))
        print(f"{os.environ.get('RMW_IMPLEMENTATION', 'the default RMW')}; rounds: {args.rounds}")
        for name in args.sections:
            SECTIONS[name](bench)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        raise SystemExit(130) from None
