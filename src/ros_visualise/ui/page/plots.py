"""Rates and latencies over the last minute."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence

import numpy as np
import viser
from viser import uplot

from ros_visualise.graph import Graph
from ros_visualise.plotting.colors import PALETTE, css
from ros_visualise.runtime.report import RunReport

_KEPT = 60


class Plots:
    """Two plots in the present container, one line for each topic.

    What comes from outside has no latency.
    """

    def __init__(self, gui: viser.GuiApi, graph: Graph) -> None:
        self._publishers = {name: topic.publisher for name, topic in graph.topics.items()}
        self._start_s = time.monotonic()
        self._rates = _Plot(gui, "messages per second", list(self._publishers))
        self._made = [name for name, node in self._publishers.items() if graph.node(node).inputs]
        self._latencies = _Plot(gui, "ms since the source", self._made)

    def add(self, report: RunReport) -> None:
        """Go on with the rates and latencies of a run report."""
        now_s = time.monotonic() - self._start_s
        rates = {name: topic.wall_hz or 0.0 for name, topic in report.topics.items()}
        self._rates.add(now_s, [rates.get(topic, 0.0) for topic in self._publishers])
        makers = [report.nodes[self._publishers[topic]] for topic in self._made]
        self._latencies.add(now_s, [maker.p50_ms for maker in makers])

    def remove(self) -> None:
        """Take them off the page."""
        self._rates.remove()
        self._latencies.remove()


class _Plot:
    def __init__(self, gui: viser.GuiApi, title: str, topics: Sequence[str]) -> None:
        self._rows: deque[list[float]] = deque(maxlen=_KEPT)
        self._element = add_plot(gui, title, topics) if topics else None

    def add(self, time_s: float, values: Sequence[float | None]) -> None:
        self._rows.append([time_s, *(float("nan") if value is None else value for value in values)])
        if self._element is not None and len(self._rows) > 1:
            self._element.data = tuple(np.array(self._rows, np.float64).T.copy())

    def remove(self) -> None:
        if self._element is not None:
            self._element.remove()


def add_plot(gui: viser.GuiApi, title: str, topics: Sequence[str]) -> viser.GuiUplotHandle:
    """An empty plot over seconds with a line for each of these names, in the present container."""
    series = [uplot.Series(label="s")]
    series += [
        uplot.Series(label=name, stroke=css(PALETTE[number % len(PALETTE)]), width=1.5)
        for number, name in enumerate(topics)
    ]
    empty = tuple(np.zeros(2) for _ in series)
    axis = uplot.Axis(stroke="#909296", grid={"stroke": "#88888833"})
    return gui.add_uplot(
        empty,
        tuple(series),
        title=title,
        scales={"x": uplot.Scale(time=False)},
        axes=(axis, axis),
        aspect=1.6,
    )
