"""Images from one process to another, and nothing else; and players of videos."""

import json
import statistics
import subprocess
import sys
from functools import partial

import peers
from bench import Bench
from measure import measure, sent_by_rate
from report import FIGURES, cells, header, number, ratio, row, title
from videos import RATE_HZ, still

_ENDS = peers.HERE / "ends.py"
_KEYS = ("fps", "publisher_ms", "subscriber_ms")
BASE = "rospy to rospy"


def run(bench: Bench) -> None:
    title("Transport alone: bgr8 images from one process to another")
    header(
        "size", "from and to", "asked", "fps", "of rospy", "publisher CPU ms", "subscriber CPU ms",
        "CPU of rospy",
    )  # fmt: skip
    for size in bench.videos:
        rounds = [_round(bench, size) for _ in range(bench.rounds)]
        figures = {name: _medians([one[name] for one in rounds]) for name in rounds[0]}
        base_fps, *base_cpu = figures[BASE]
        for name, (fps, sent_ms, taken_ms) in figures.items():
            pair, _, asked = name.partition(", ")
            of_fps = "-" if asked else ratio(fps, base_fps)
            of_cpu = ratio(sent_ms + taken_ms, sum(base_cpu))
            times = (number(sent_ms, 2), number(taken_ms, 2))
            row(size, pair, asked or "all", number(fps), of_fps, *times, of_cpu)


def run_players(bench: Bench) -> None:
    title(f"Playing a video on a topic at {RATE_HZ} fps")
    header("size", "node", *FIGURES, "CPU of")
    for size, video in bench.videos.items():
        candidates = {
            "image_publisher (C++)": peers.image_publisher(video, RATE_HZ),
            "streamer": peers.ours("streamer", path=video, loop=True),
        }
        measured = bench.rounds_of(
            {name: partial(_play, bench, command) for name, command in candidates.items()}
        )
        base = measured["image_publisher (C++)"]
        for name, one in measured.items():
            row(size, name, *cells(one), ratio(one.cpu_ms, base.cpu_ms))


def _play(bench: Bench, command: peers.Command):
    with bench.graph.running(command) as pids:
        return measure("/image_raw", pids, bench.window, sent_by_rate(RATE_HZ))


def _round(bench: Bench, size: str) -> dict[str, tuple[float, float, float]]:
    video = bench.videos[size]
    ours_at_rate = _publisher("ours", video, "--rate", RATE_HZ)
    from_cpp = peers.image_publisher(still(video), RATE_HZ)
    return {
        BASE: _pair(bench, _publisher("rospy", video), "rospy"),
        "ours to rospy": _pair(bench, _publisher("ours", video), "rospy"),
        "rospy to ours": _pair(bench, _publisher("rospy", video), "ours"),
        "ours to ours": _pair(bench, _publisher("ours", video), "ours"),
        f"image_publisher (C++) to ours, {RATE_HZ}": _pair(bench, from_cpp, "ours"),
        f"ours to ours, {RATE_HZ}": _pair(bench, ours_at_rate, "ours"),
    }


def _publisher(kind: str, *arguments: object) -> peers.Command:
    return [sys.executable, _ENDS, "publish", kind, *map(str, arguments)]


def _pair(bench: Bench, publisher: peers.Command, kind: str) -> tuple[float, float, float]:
    with bench.graph.running(publisher) as (pid,):
        command = [sys.executable, str(_ENDS), "subscribe", kind, str(pid)]
        command += ["--seconds", str(bench.window.seconds)]
        command += ["--warmup", str(bench.window.warmup_s)]
        done = subprocess.run(
            command, env=bench.graph.environment, stdout=subprocess.PIPE, check=True, timeout=120
        )
    figures = json.loads(done.stdout.splitlines()[-1])
    nothing = {"fps": 0.0, "publisher_ms": float("nan"), "subscriber_ms": float("nan")}
    fps, sent_ms, taken_ms = ({**nothing, **figures}[key] for key in _KEYS)
    return fps, sent_ms, taken_ms


def _medians(rounds: list[tuple[float, float, float]]) -> tuple[float, float, float]:
    fps, sent_ms, taken_ms = (statistics.median(column) for column in zip(*rounds, strict=True))
    return fps, sent_ms, taken_ms
