"""Plots of tables: curves over the first column, or bars where that holds names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Floats
from ros_visualise.plotting.axes import PlotAxes
from ros_visualise.plotting.colors import BLUE, GREEN, ORANGE, RED, Color
from ros_visualise.plotting.figure import Box, Figure

_COLORS: tuple[Color, ...] = (BLUE, ORANGE, GREEN, RED)
_BOX: Box = (70, 40, 700, 360)
_ROW, _MOST_BARS = 20, 100
_NAMES = 260  # width of the names of bars


def plot_columns(columns: Mapping[str, Any]) -> Figure:
    """Draw the numeric columns of a table over its first one; rows without a number are skipped.

    Raises:
        UsageError: no numbers to draw.
    """
    first, *others = columns
    curves = {name: _numbers(columns[name]) for name in others if _is_number(columns[name])}
    if not curves or not len(columns[first]):
        raise UsageError("nothing to draw: give rows, and numbers after the first column")
    if not _is_number(columns[first]):
        name, lengths = next(iter(curves.items()))
        return _bars([str(one) for one in columns[first]], lengths, name)
    across = _numbers(columns[first])
    figure = Figure(800, 470)
    drawn = [np.stack([across, up], axis=1) for up in curves.values()]
    shown = np.concatenate([one[np.isfinite(one).all(axis=1)] for one in drawn])
    if not len(shown):
        raise UsageError("nothing to draw: all numbers are missing")
    axes = PlotAxes(figure, _BOX, shown.min(axis=0), shown.max(axis=0))
    axes.draw(first, "")
    for number, (name, points) in enumerate(zip(curves, drawn, strict=True)):
        color = _COLORS[number % len(_COLORS)]
        axes.curve(points[np.isfinite(points).all(axis=1)], color)
        figure.text(_BOX[0] + 140 * number, 28, name, color=color)
    return figure


def _bars(names: list[str], lengths: Floats, title: str) -> Figure:
    lengths = np.nan_to_num(lengths[:_MOST_BARS])
    figure = Figure(800, 50 + _ROW * len(lengths))
    figure.text(_NAMES, 24, title)
    scale = 400 / max(float(np.abs(lengths).max()), 1e-12)
    for number, (name, length) in enumerate(zip(names, lengths.tolist(), strict=False)):
        top = 36.0 + _ROW * number
        figure.text(_NAMES - 8, top + 12, name[-40:], 11, "end")
        figure.fill((_NAMES, top, abs(length) * scale, _ROW - 6), BLUE if length >= 0 else RED)
        figure.text(_NAMES + abs(length) * scale + 6, top + 12, f"{length:.6g}", 11)
    return figure


def _is_number(column: Any) -> bool:
    return np.asarray(column).dtype.kind in "iufb"


def _numbers(column: Any) -> Floats:
    return np.ma.filled(np.ma.asarray(column, np.float64), np.nan)
