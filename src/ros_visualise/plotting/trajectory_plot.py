"""Plots of trajectories: in the planes in which they move, over time, and their errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle, pairwise, zip_longest

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Path
from ros_visualise.plotting.axes import PlotAxes
from ros_visualise.plotting.colors import BLUE, GRAY, INK, Color
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

WIDTH = 800
"""Width of a figure, units of 1/96 inch."""
_LEFT, _RIGHT = 70, 30
_TALL, _LOW = 0.66, 0.2  # heights of the panels, as fractions of their width
_THIRD = 0.37  # a panel's height where there are three planes
_LEAST_LOW = 90
_TOP, _GAP = 30, 72
_TITLE = 38
_LEGEND_ROW = 18
_GAP_TIMES, _LEAST_GAP_NS = 10, 1_000_000_000
"""A line ends where the next pose comes later than so many usual intervals, and than a second."""


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
    drawn: Sequence[PlottedTrajectory],
    planes: Sequence[Plane],
    title: str,
    stamped: bool,
    width: int = WIDTH,
) -> Figure:
    """Draw trajectories; the later ones are drawn over the earlier ones, gaps are not bridged.

    Args:
        drawn: the trajectories.
        planes: planes to draw; with only one, the third axis is drawn over time.
        title: title of the figure; empty: none.
        stamped: True if all of them have times; else their poses are numbered.
        width: of the figure, units of 1/96 inch.
    """
    wide = width - _LEFT - _RIGHT
    tall = round(wide * (_TALL if len(planes) == 1 else _THIRD))
    low = max(round(wide * _LOW), _LEAST_LOW)
    series = _series(drawn, planes, stamped)
    head = _TITLE if title else 0
    top = head + _TOP + (_LEGEND_ROW * len(drawn) if len(drawn) > 1 else 0)
    height = top + len(planes) * (tall + _GAP) + len(series) * (low + _GAP) - 12
    figure = Figure(width, height)
    figure.text(_LEFT, 28, title, 15, color=(20, 20, 20))
    if len(drawn) > 1:
        _draw_legend(figure, drawn, head + 14)
    for plane in planes:
        _draw_plane(figure, (_LEFT, top, wide, tall), drawn, plane, stamped)
        top += tall + _GAP
    for name, curves in series:
        across = "time (s)" if stamped else "pose"
        _draw_series(figure, (_LEFT, top, wide, low), curves, (across, name), _span(series))
        top += low + _GAP
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


def _draw_legend(figure: Figure, drawn: Sequence[PlottedTrajectory], top: float) -> None:
    for row, (one, (color, _)) in enumerate(zip(drawn, _styles(drawn), strict=True)):
        y = top + row * _LEGEND_ROW
        figure.line(np.array([[_LEFT, y], [_LEFT + 24, y]]), color, 3)
        figure.text(_LEFT + 32, y + 4, _label(one))


def _draw_plane(
    figure: Figure, box: Box, drawn: Sequence[PlottedTrajectory], plane: Plane, stamped: bool
) -> None:
    """Draw the paths; a dot is the start of each, a square its end."""
    curves = [one.path.positions_xyz[:, plane] for one in drawn]
    points = np.concatenate(curves)
    axes = PlotAxes(figure, box, points.min(axis=0), points.max(axis=0), equal=True)
    axes.draw(*(f"{AXES[axis]} (m)" for axis in plane))
    styles = _styles(drawn)
    for one, curve, (color, _) in zip(drawn, curves, styles, strict=True):
        for piece in _pieces(one.path.stamps_ns, stamped):
            axes.curve(curve[piece], color)
    for curve, (color, _) in zip(curves, styles, strict=True):
        start, end = axes.places(curve[[0, -1]])
        figure.dot(start[0], start[1], 4.5, color)
        _square(figure, end, 8, color)
    right, y = box[0] + box[2], box[1] - 12
    figure.dot(right - 84, y, 4, INK)
    figure.text(right - 75, y + 4, "start")
    _square(figure, np.array([right - 32, y]), 8, INK)
    figure.text(right - 23, y + 4, "end")


def _square(figure: Figure, center: Floats, side: float, color: Color) -> None:
    figure.fill((center[0] - side / 2, center[1] - side / 2, side, side), color)


def _pieces(stamps_ns: npt.NDArray[np.int64], stamped: bool) -> list[slice]:
    """The parts of a trajectory without a gap in time."""
    steps = np.diff(stamps_ns)
    if not stamped or not len(steps):
        return [slice(None)]
    usual_ns = np.median(steps)
    ends = np.flatnonzero((steps > _GAP_TIMES * usual_ns) & (steps > _LEAST_GAP_NS)) + 1
    return [slice(*pair) for pair in pairwise([0, *ends.tolist(), len(stamps_ns)])]


_Curve = tuple[list[Floats], Color]
"""Lines (N, 2) of one colour."""


def _series(
    drawn: Sequence[PlottedTrajectory], planes: Sequence[Plane], stamped: bool
) -> list[tuple[str, list[_Curve]]]:
    """(Name, curves) of the plots over time."""
    moments = [
        one.path.stamps_ns if stamped else np.arange(len(one.path.stamps_ns)) for one in drawn
    ]
    zero, unit = min(one[0] for one in moments), 1e9 if stamped else 1

    def lines(when: npt.NDArray[np.int64], values: Floats) -> list[Floats]:
        points = np.stack([(when - zero) / unit, values], axis=1)
        return [points[piece] for piece in _pieces(when, stamped)]

    styles = _styles(drawn)
    found = []
    if len(planes) == 1:
        axis = other_axis(planes[0])
        curves = [
            (lines(when, one.path.positions_xyz[:, axis]), color)
            for one, when, (color, _) in zip(drawn, moments, styles, strict=True)
        ]
        found.append((f"{AXES[axis]} (m)", curves))
    errors = [
        (lines(*one.errors), color)
        for one, (color, _) in zip(drawn, styles, strict=True)
        if one.errors is not None
    ]
    return [*found, ("distance from the truth (m)", errors)] if errors else found


def _points(curves: Sequence[_Curve]) -> Floats:
    return np.concatenate([line for lines, _ in curves for line in lines])


def _span(series: Sequence[tuple[str, Sequence[_Curve]]]) -> Floats:
    moments = np.concatenate([_points(curves)[:, 0] for _, curves in series])
    return np.array([moments.min(), moments.max()])


def _draw_series(
    figure: Figure,
    box: Box,
    curves: Sequence[_Curve],
    names: tuple[str, str],
    span: Floats,
) -> None:
    """Draw one plot over time; all of them span the same (2,) moments."""
    values = _points(curves)[:, 1]
    low, high = np.array([span, [values.min(), values.max()]]).T
    axes = PlotAxes(figure, box, low, high)
    axes.draw(*names)
    for lines, color in curves:
        for line in lines:
            axes.curve(line, color)


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
