"""Plots of trajectories: in the planes in which they move, over time, and their errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle, zip_longest

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Path
from ros_visualise.plotting.axes import PlotAxes
from ros_visualise.plotting.colors import BLUE, GRAY, GREEN, RED, Color
from ros_visualise.plotting.figure import Box, Figure
from ros_visualise.plotting.text_plot import draw_text

_STYLES: tuple[tuple[Color, str], ...] = (
    (BLUE, "*"),
    ((226, 120, 20), "o"),
    ((130, 70, 170), "x"),
    ((0, 150, 136), "+"),
    ((190, 60, 120), "%"),
)
_TRUTH: tuple[Color, str] = GRAY, "."
"""Colours and letters."""

_LEFT, _WIDE = 70, 700
_TALL, _LOW = 460, 140
_THIRD = 260  # a panel's height where there are three planes
_TOP, _GAP = 68, 72
_LEGEND_ROW = 18


@dataclass(frozen=True)
class PlottedTrajectory:
    """A trajectory to plot.

    Attributes:
        name: its name in the legend.
        path: its poses, at least one.
        is_truth: True if the others are compared with it.
        errors: stamps or numbers of poses (N,), and their distances from the truth (N,), metres.
    """

    name: str
    path: Path
    is_truth: bool = False
    errors: tuple[npt.NDArray[np.int64], Floats] | None = None


def plot_trajectories(
    drawn: Sequence[PlottedTrajectory], planes: Sequence[Plane], title: str, stamped: bool
) -> Figure:
    """Draw trajectories; the later ones are drawn over the earlier ones.

    Args:
        drawn: the trajectories.
        planes: planes to draw; with only one, the third axis is drawn over time.
        title: title of the figure.
        stamped: True if all of them have times; else their poses are numbered.
    """
    legend = _LEGEND_ROW * len(drawn) if len(drawn) > 1 else 0
    tall = _TALL if len(planes) == 1 else _THIRD
    series = _series(drawn, planes, stamped)
    height = _TOP + legend + len(planes) * (tall + _GAP) + len(series) * (_LOW + _GAP) - 12
    figure = Figure(800, height)
    figure.text(_LEFT, 28, title, 15, color=(20, 20, 20))
    if legend:
        _draw_legend(figure, drawn)
    top = _TOP + legend
    for plane in planes:
        _draw_plane(figure, (_LEFT, top, _WIDE, tall), drawn, plane)
        top += tall + _GAP
    for name, curves in series:
        across = "time (s)" if stamped else "pose"
        _draw_series(figure, (_LEFT, top, _WIDE, _LOW), curves, (across, name), _span(series))
        top += _LOW + _GAP
    return figure


def draw_in_text(
    drawn: Sequence[PlottedTrajectory], planes: Sequence[Plane], columns: int, rows: int
) -> list[str]:
    """The same planes drawn with letters, side by side, and a legend."""
    letters = [letter for _, letter in _styles(drawn)]
    each = columns // len(planes) - 1
    panels = []
    for across, up in planes:
        points = [one.path.positions_xyz[:, (across, up)] for one in drawn]
        curves = list(zip(letters, points, strict=True))
        panels.append(draw_text(curves, f"{AXES[across]} (m)", f"{AXES[up]} (m)", each, rows))
    lines = [
        " ".join(line.ljust(each) for line in row).rstrip()
        for row in zip_longest(*panels, fillvalue="")
    ]
    if len(drawn) > 1:
        lines += [f"{letter} {_label(one)}" for letter, one in zip(letters, drawn, strict=True)]
    return lines


def _styles(drawn: Sequence[PlottedTrajectory]) -> list[tuple[Color, str]]:
    styles = cycle(_STYLES)
    return [_TRUTH if one.is_truth else next(styles) for one in drawn]


def _label(one: PlottedTrajectory) -> str:
    return f"{one.name} (truth)" if one.is_truth else one.name


def _draw_legend(figure: Figure, drawn: Sequence[PlottedTrajectory]) -> None:
    for row, (one, (color, _)) in enumerate(zip(drawn, _styles(drawn), strict=True)):
        y = 52 + row * _LEGEND_ROW
        figure.line(np.array([[_LEFT, y], [_LEFT + 24, y]]), color, 3)
        figure.text(_LEFT + 32, y + 4, _label(one))


def _draw_plane(figure: Figure, box: Box, drawn: Sequence[PlottedTrajectory], plane: Plane) -> None:
    curves = [one.path.positions_xyz[:, plane] for one in drawn]
    points = np.concatenate(curves)
    axes = PlotAxes(figure, box, points.min(axis=0), points.max(axis=0), equal=True)
    axes.draw(*(f"{AXES[axis]} (m)" for axis in plane))
    for curve, (color, _) in zip(curves, _styles(drawn), strict=True):
        axes.curve(curve, color)
    for name, color, x, place in (
        ("start", GREEN, 650, axes.places(curves[0][:1])[0]),
        ("end", RED, 715, axes.places(curves[0][-1:])[0]),
    ):
        figure.dot(place[0], place[1], 5, color)
        figure.dot(x, box[1] - 12, 4, color)
        figure.text(x + 9, box[1] - 8, name)


_Curve = tuple[Floats, Color]


def _series(
    drawn: Sequence[PlottedTrajectory], planes: Sequence[Plane], stamped: bool
) -> list[tuple[str, list[_Curve]]]:
    """(Name, curves) of the plots over time, in points (N, 2)."""
    moments = [
        one.path.stamps_ns if stamped else np.arange(len(one.path.stamps_ns)) for one in drawn
    ]
    zero, unit = min(one[0] for one in moments), 1e9 if stamped else 1
    styles = _styles(drawn)
    found = []
    if len(planes) == 1:
        axis = other_axis(planes[0])
        curves = [
            (np.stack([(when - zero) / unit, one.path.positions_xyz[:, axis]], axis=1), color)
            for one, when, (color, _) in zip(drawn, moments, styles, strict=True)
        ]
        found.append((f"{AXES[axis]} (m)", curves))
    errors = [
        (np.stack([(one.errors[0] - zero) / unit, one.errors[1]], axis=1), color)
        for one, (color, _) in zip(drawn, styles, strict=True)
        if one.errors is not None
    ]
    return [*found, ("distance from the truth (m)", errors)] if errors else found


def _span(series: Sequence[tuple[str, Sequence[_Curve]]]) -> Floats:
    moments = np.concatenate([curve[:, 0] for _, curves in series for curve, _ in curves])
    return np.array([moments.min(), moments.max()])


def _draw_series(
    figure: Figure,
    box: Box,
    curves: Sequence[_Curve],
    names: tuple[str, str],
    span: Floats,
) -> None:
    """Draw one plot over time; all of them span the same (2,) moments."""
    values = np.concatenate([curve[:, 1] for curve, _ in curves])
    low, high = np.array([span, [values.min(), values.max()]]).T
    axes = PlotAxes(figure, box, low, high)
    axes.draw(*names)
    for curve, color in curves:
        axes.curve(curve, color)


AXES = "xyz"
Plane = tuple[int, int]
"""The axes to the right and up."""

ALL: tuple[Plane, ...] = ((0, 1), (0, 2), (1, 2))
_JITTER = 0.05  # of the greatest extent: less counts as no movement
_THICK = 0.5  # of the second extent: a movement with a larger third is in no plane


def planes_of(positions_xyz: Sequence[Floats], wanted: str = "auto") -> tuple[Plane, ...]:
    """The planes to draw.

    Args:
        positions_xyz: positions of each path, (N, 3).
        wanted: ``xy``, ``xz``, ``yz``, ``all``, or ``auto``: the plane in which the paths move, or
            all of them if they move in all directions.
    """
    if wanted == "all":
        return ALL
    if wanted != "auto":
        return ((AXES.index(wanted[0]), AXES.index(wanted[1])),)
    low = np.min([one.min(axis=0) for one in positions_xyz], axis=0)
    extent = np.max([one.max(axis=0) for one in positions_xyz], axis=0) - low
    extent[extent < _JITTER * extent.max()] = 0
    first, second, third = np.argsort(-extent, kind="stable").tolist()
    if extent[third] > _THICK * extent[second]:
        return ALL
    return ((min(first, second), max(first, second)),)


def other_axis(plane: Plane) -> int:
    """The axis perpendicular to a plane."""
    return 3 - sum(plane)
