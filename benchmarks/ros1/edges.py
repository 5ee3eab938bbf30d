"""Edge detectors alone, fed by the same source."""

from functools import partial

import peers
from bench import Bench
from measure import Figures, measure, sent_by_log
from report import FIGURES, cells, header, ratio, row, share, title

BASE = "opencv_apps (C++)"
_INPUT = "processed_image:=image_raw"
CANDIDATES = {
    BASE: ("blur BGR 3x3, gray, Canny", peers.opencv_apps()),
    "rospy node": ("gray, Canny", peers.rospy_canny()),
    "edge_detector": ("gray, Canny", peers.ours("edge_detector", _INPUT)),
    "edge_detector, sigma 0.8": (
        "gray, blur, Canny",
        peers.ours("edge_detector", _INPUT, sigma=0.8),
    ),
}
FULL = {"480p": 400, "1080p": 120, "4K": 60}
"""More than can be taken, yet not so much that the source takes the processor for itself."""


def run(bench: Bench) -> None:
    title(
        "Edge detection alone: Canny 200/300, bgr8 to mono8",
        "From the stamp that the source sets on publishing to the edges' arrival.",
    )
    columns = ("fps of", "CPU of")
    header("size", "source", "node", "pixel work", "white", *FIGURES, *columns)
    for size in bench.videos:
        for rate in (30, FULL[size]):
            measured = bench.rounds_of(
                {
                    name: partial(_measure, bench, size, rate, command)
                    for name, (_, command) in CANDIDATES.items()
                }
            )
            base = measured[BASE]
            for name, one in measured.items():
                row(
                    size,
                    f"{rate} fps",
                    name,
                    CANDIDATES[name][0],
                    share(one.white),
                    *cells(one),
                    ratio(one.fps, base.fps),
                    ratio(one.cpu_ms, base.cpu_ms),
                )


def _measure(bench: Bench, size: str, rate: float, command: peers.Command) -> Figures:
    log = bench.graph.scratch / "stamps"
    log.unlink(missing_ok=True)
    source = peers.source(bench.videos[size], rate, log)
    with bench.graph.running(command, source) as (node, _):
        return measure("/edges", [node], bench.window, sent_by_log(log))
