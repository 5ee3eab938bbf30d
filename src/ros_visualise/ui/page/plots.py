"""Rates and latencies over the last minute."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
from viser import uplot

_KEPT = 60
_COLORS = ("#4dabf7", "#69db7c", "#ffd43b", "#ff8787", "#da77f2", "#ffa94d", "#3bc9db")


class Plots:
    """Two plots in the present container, one line for each topic."""

    def __init__(self, gui: viser.GuiApi, topics: Sequence[str]) -> None:
        self._topics = topics
        self._start_s = time.monotonic()
        self._rows: deque[list[float]] = deque(maxlen=_KEPT)
        self._rates = _add_plot(gui, "messages per second", topics)

    def add(self, report: dict[str, Any]) -> None:
        """Go on with the rates of a run report."""
        rates = [report["topics"].get(name, {}).get("wall_hz") for name in self._topics]
        now_s = time.monotonic() - self._start_s
        self._rows.append([now_s] + [np.nan if rate is None else rate for rate in rates])
        if len(self._rows) > 1:
            self._rates.data = tuple(np.array(self._rows, np.float64).T.copy())


def _add_plot(gui: viser.GuiApi, title: str, topics: Sequence[str]) -> viser.GuiUplotHandle:
    series = [uplot.Series(label="s")]
    series += [
        uplot.Series(label=name, stroke=_COLORS[number % len(_COLORS)], width=1.5)
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
