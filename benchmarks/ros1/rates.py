"""Rate control: what comes out when a rate is asked for."""

import threading
from dataclasses import replace

import peers
from bench import Bench
from measure import Figures, measure
from report import header, number, ratio, row, title
from videos import RATE_HZ

_RATES = (5, 7, 10, 15, 20, 24, 25, 29)


def run(bench: Bench) -> None:
    title(f"Rate control: asked for a rate out of {RATE_HZ} Hz, both at the same time")
    header(
        "asked", "topic_tools throttle (C++)", "of it", "CPU ms", "fps_control", "of it", "CPU ms"
    )
    for rate in (15, 25) if bench.quick else _RATES:
        throttled, controlled = _measure(bench, rate)
        row(rate, *_cells(throttled, rate), *_cells(controlled, rate))


def _cells(figures: Figures, asked: float) -> tuple[str, str, str]:
    return number(figures.fps, 2), ratio(figures.fps, asked), number(figures.cpu_ms, 2)


def _measure(bench: Bench, rate: float) -> list[Figures]:
    topics = ("throttled", "controlled_stream")
    commands = (peers.throttle(rate, topics[0]), peers.ours("fps_control", fps=rate))
    source = peers.source(next(iter(bench.videos.values())), RATE_HZ)
    window = replace(bench.window, seconds=bench.window.seconds + 10 / rate)
    results = [Figures(), Figures()]

    def follow(place: int, pid: int) -> None:
        results[place] = measure(f"/{topics[place]}", [pid], window)

    with bench.graph.running(source, *commands) as (_, *nodes):
        threads = [threading.Thread(target=follow, args=item) for item in enumerate(nodes)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    return results
