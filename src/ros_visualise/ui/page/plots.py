"""Plots over time: rates and latencies of all topics, and fields of messages."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import viser
from viser import uplot

from ros_visualise.data import Message
from ros_visualise.geometry.thinning import evenly
from ros_visualise.graph import Graph
from ros_visualise.plotting.colors import PALETTE, css
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.report import RunReport
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.live.trees import fields_of
from ros_visualise.ui.page.controls import set_value

_KEPT = 60


class Plots:
    """Plots of rates and latencies, a line for each topic; topics from outside have no latency."""

    def __init__(self, gui: viser.GuiApi, graph: Graph) -> None:
        self._publishers = {name: topic.publisher for name, topic in graph.topics.items()}
        self._start_s = time.monotonic()
        self._rates = _Plot(gui, "Messages per second", list(self._publishers))
        self._made = [name for name, node in self._publishers.items() if graph.node(node).inputs]
        self._latencies = _Plot(gui, "Latency from the source, ms", self._made)

    def add(self, report: RunReport) -> None:
        now_s = time.monotonic() - self._start_s
        rates = {name: topic.wall_hz or 0.0 for name, topic in report.topics.items()}
        self._rates.add(now_s, [rates.get(topic, 0.0) for topic in self._publishers])
        makers = [report.nodes[self._publishers[topic]] for topic in self._made]
        self._latencies.add(now_s, [maker.p50_ms for maker in makers])

    def remove(self) -> None:
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


_NONE = "–"
_LINES = 4
_OFFERED = 200  # fields; the tab *Plots* has all
_KEPT = 20_000
_DRAWN = 1500  # samples of a line that are sent at most
_WAITING = 1000
_NS = 1_000_000_000


class FieldHistory:
    """Numbers of some fields over the last seconds, by the message stamps."""

    def __init__(self, paths: Sequence[str]) -> None:
        self.paths = list(paths)
        self._rows: deque[tuple[float, ...]] = deque(maxlen=_KEPT)
        self._first_ns: int | None = None
        self._epoch = 0

    def add(self, stamp_ns: int, fields: Mapping[str, float], epoch: int) -> None:
        """Add a message, unless it is late; begin anew after a time jump."""
        if self._first_ns is None or epoch != self._epoch:
            self._rows.clear()
            self._first_ns, self._epoch = stamp_ns, epoch
        elif self._time_s(stamp_ns) < self._rows[-1][0]:
            return
        values = (fields.get(path, float("nan")) for path in self.paths)
        self._rows.append((self._time_s(stamp_ns), *values))

    def columns(self, length_s: float) -> tuple[np.ndarray[Any, np.dtype[np.float64]], ...]:
        """Seconds since the first message, and each field: (N,) each, evenly thinned."""
        rows = np.array(self._rows, np.float64).reshape(-1, 1 + len(self.paths))
        if len(rows):
            rows = rows[rows[:, 0] >= rows[-1, 0] - length_s]
        return tuple(column.copy() for column in rows[evenly(len(rows), _DRAWN)].T)

    def _time_s(self, stamp_ns: int) -> float:
        return (stamp_ns - (self._first_ns or 0)) / _NS


class FieldPlot:
    """Choices of a topic and of its fields, and their plot, in the present container."""

    def __init__(self, gui: viser.GuiApi, runtime: Runtime) -> None:
        self._gui = gui
        self._topic = gui.add_dropdown("Topic", (_NONE,))
        self._fields = [
            gui.add_dropdown(f"Field {number + 1}", (_NONE,), visible=False)
            for number in range(_LINES)
        ]
        self._length = gui.add_slider("Seconds", 5, 120, 5, 30, visible=False)
        self._place = gui.add_folder(None)
        self._plot: viser.GuiUplotHandle | None = None
        self._history = FieldHistory([])
        self._feed = Feed(runtime, _WAITING)
        self._followed = _NONE
        self._known: tuple[str, ...] = ()

    def follow(self, topics: Mapping[str, type[Message]]) -> None:
        """Offer these topics; given with the classes of their messages."""
        names = [name for name, kind in topics.items() if kind.plotted]
        if self._topic.value not in names:
            set_value(self._topic, _NONE)
        self._topic.options = (_NONE, *names)

    def refresh(self) -> None:
        if self._topic.value != self._followed:
            self._begin(self._topic.value)
        if self._followed == _NONE:
            return
        self._feed.follow(self._followed)
        chosen = [field.value for field in self._fields if field.value != _NONE]
        if chosen != self._history.paths:
            self._history = FieldHistory(chosen)
            self._replot()
        news = False
        while (message := self._feed.take()) is not None:
            self._add(message)
            news = True
        if news and self._plot is not None:
            columns = self._history.columns(self._length.value)
            if len(columns[0]) > 1:
                self._plot.data = columns

    def rest(self) -> None:
        self._feed.follow(None)

    def _begin(self, topic: str) -> None:
        self.rest()
        self._followed, self._known = topic, ()
        is_chosen = topic != _NONE
        for element in (*self._fields, self._length):
            element.visible = is_chosen
        for field in self._fields:
            set_value(field, _NONE)
            field.options = (_NONE,)
        self._history = FieldHistory([])
        self._replot()

    def _add(self, message: Any) -> None:
        fields = fields_of(message)
        if not self._known and fields:
            self._offer(tuple(fields))
        self._history.add(message.header.stamp_ns, fields, self._feed.epoch)

    def _offer(self, paths: tuple[str, ...]) -> None:
        """Offer these fields, and choose the first one outside of the header."""
        self._known = paths
        for field in self._fields:
            field.options = (_NONE, *paths[:_OFFERED])
        first = next((path for path in paths if not path.startswith("header.")), None)
        if first is not None:
            set_value(self._fields[0], first)

    def _replot(self) -> None:
        if self._plot is not None:
            self._plot.remove()
            self._plot = None
        if self._history.paths:
            with self._place:
                self._plot = add_plot(self._gui, self._followed, self._history.paths)
