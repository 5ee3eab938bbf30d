"""The whole chain: streamer -> fps_control -> filters -> edge_detector."""

import json
import subprocess
import sys
from collections.abc import Callable
from functools import partial

import peers
from bench import Bench
from measure import Figures, measure, sent_by_log, sent_by_rate
from report import FIGURES, cells, header, ratio, row, title
from seed import Seed
from videos import RATE_HZ, lengthen

SEED, AS_IT_IS = "the seed, no windows", "the seed as it is"
NODES, PIPELINE, LOCAL = "separate nodes", "pipeline", "local runtime, no ROS"
_SEED_FRAMES = {"480p": 15000, "1080p": 4000, "4K": 2000}
"""How much the seed, which plays at decoding speed and does not loop, goes through at most."""


def run(bench: Bench) -> None:
    title(
        "The whole chain, as fast as it goes",
        "A video file to /edges (the seed's /detected). filters as they start: gray, truncated at "
        "128. The seed's rate control lets at most 30 fps pass, ours is off. CPU of all processes.",
    )
    header("size", "chain", "fps", "CPU ms", "fps of the seed", "fps of local", "CPU of the seed")
    for size in bench.videos:
        measured = bench.rounds_of(_throughput(bench, size))
        seed, local = measured.get(SEED, Figures()), measured[LOCAL]
        for name, one in measured.items():
            of = (ratio(one.fps, seed.fps), ratio(one.fps, local.fps))
            row(size, name, *cells(one)[:2], *of, ratio(one.cpu_ms, seed.cpu_ms))


def run_live(bench: Bench) -> None:
    title(
        f"The whole chain at {RATE_HZ} fps",
        "From the source's stamp to the arrival at /edges. Fed by the same source as single nodes "
        "are (the seed drops stamps: they are written into pixels), or by our streamer, which "
        "stamps an image with the time at which it is due. CPU of all processes but that source.",
    )
    header("size", "source", "chain", *FIGURES, "p50 of the seed")
    for size in bench.videos:
        measured = bench.rounds_of(_live(bench, size))
        seed = measured.get(f"source, {SEED}", Figures())
        for name, one in measured.items():
            source, _, chain = name.partition(", ")
            row(size, source, chain, *cells(one), ratio(one.p50_ms, seed.p50_ms))


def _throughput(bench: Bench, size: str) -> dict[str, Callable[[], Figures]]:
    candidates = {
        NODES: partial(_edges, bench, [*_nodes(enabled=False), _streamer(bench, size, rate=0)]),
        PIPELINE: partial(_edges, bench, [_pipeline(bench, size, rate=0)]),
        LOCAL: partial(_local, bench, size),
    }
    for name, seed in ((AS_IT_IS, bench.seed_as_it_is), (SEED, bench.seed)):
        if seed is not None:
            candidates = {name: partial(_play_seed, bench, seed, size)} | candidates
    return candidates


def _live(bench: Bench, size: str) -> dict[str, Callable[[], Figures]]:
    candidates = {
        f"source, {NODES}": partial(_fed, bench, size, _nodes()),
        f"source, {PIPELINE}": partial(_fed, bench, size, [peers.ours("pipeline")]),
        f"streamer, {NODES}": partial(_live_edges, bench, [*_nodes(), _streamer(bench, size)]),
        f"streamer, {PIPELINE}": partial(_live_edges, bench, [_pipeline(bench, size)]),
    }
    if bench.seed is not None:
        candidates = {f"source, {SEED}": partial(_feed_seed, bench, bench.seed, size)} | candidates
    return candidates


def _nodes(enabled: bool = True) -> list[peers.Command]:
    return [
        peers.ours("fps_control", enabled=enabled),
        peers.ours("filters"),
        peers.ours("edge_detector"),
    ]


def _streamer(bench: Bench, size: str, rate: float = 1) -> peers.Command:
    return peers.ours("streamer", path=bench.videos[size], loop=True, rate=rate)


def _pipeline(bench: Bench, size: str, rate: float = 1) -> peers.Command:
    return peers.ours(
        "pipeline",
        source="streamer",
        streamer__path=bench.videos[size],
        streamer__loop=True,
        streamer__rate=rate,
        fps_control__enabled=rate > 0,
    )


def _edges(bench: Bench, commands: list[peers.Command]) -> Figures:
    """Of a chain whose stamps are the video's own, not the time of day."""
    with bench.graph.running(*commands) as pids:
        return measure("/edges", pids, bench.window, stamp_of=lambda head: 0)


def _live_edges(bench: Bench, commands: list[peers.Command]) -> Figures:
    with bench.graph.running(*commands) as pids:
        return measure("/edges", pids, bench.window, sent_by_rate(RATE_HZ))


def _fed(bench: Bench, size: str, commands: list[peers.Command]) -> Figures:
    log = bench.graph.scratch / "stamps"
    log.unlink(missing_ok=True)
    source = peers.source(bench.videos[size], RATE_HZ, log)
    with bench.graph.running(*commands, source) as (*pids, _):
        return measure("/edges", pids, bench.window, sent_by_log(log))


def _play_seed(bench: Bench, seed: Seed, size: str) -> Figures:
    video = lengthen(bench.videos[size], _SEED_FRAMES[size])
    with bench.graph.running(*seed.nodes(), seed.streamer(video)) as pids:
        return measure("/detected", pids, bench.window)


def _feed_seed(bench: Bench, seed: Seed, size: str) -> Figures:
    log = bench.graph.scratch / "stamps"
    log.unlink(missing_ok=True)
    source = peers.source(bench.videos[size], RATE_HZ, log, mark=True)
    with bench.graph.running(*seed.nodes(), source) as (*pids, _):
        return measure("/detected", pids, bench.window, sent_by_log(log), lambda head: head.mark_ns)


def _local(bench: Bench, size: str) -> Figures:
    command = [sys.executable, str(peers.HERE / "local.py"), str(bench.videos[size])]
    command += ["--seconds", str(bench.window.seconds), "--warmup", str(bench.window.warmup_s)]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True, timeout=120)
    return Figures(**json.loads(done.stdout))
