"""Rectification alone: `image_proc` and our node, fed by the same source."""

from functools import partial

import peers
from bench import Bench
from measure import Figures, measure, sent_by_log
from report import FIGURES, cells, header, ratio, row, title

BASE = "image_proc (C++)"
CANDIDATES = {
    BASE: ("/image_rect_color", peers.image_proc()),
    "rectify": ("/image_rect", peers.ours("rectify")),
}


def run(bench: Bench) -> None:
    title(
        "Rectification alone: plumb_bob, bgr8, bilinear",
        "From the stamp that the source sets on publishing to the image's arrival.",
    )
    header("size", "node", *FIGURES, "fps of", "CPU of")
    for size in bench.videos:
        measured = bench.rounds_of(
            {name: partial(_measure, bench, size, *one) for name, one in CANDIDATES.items()}
        )
        base = measured[BASE]
        for name, one in measured.items():
            compared = ratio(one.fps, base.fps), ratio(one.cpu_ms, base.cpu_ms)
            row(size, name, *cells(one), *compared)


def _measure(bench: Bench, size: str, topic: str, command: peers.Command) -> Figures:
    log = bench.graph.scratch / "stamps"
    log.unlink(missing_ok=True)
    source = [*peers.source(bench.videos[size], 30, log), "--lens"]
    with bench.graph.running(command, source) as (node, _):
        return measure(topic, [node], bench.window, sent_by_log(log))
