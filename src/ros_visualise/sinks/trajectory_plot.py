"""A picture of a trajectory: from above, and its height over time."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Path
from ros_visualise.sinks.axes import Axes
from ros_visualise.sinks.figure import Color, Figure

_WAY: Color = (31, 111, 178)
_START: Color = (44, 145, 60)
_END: Color = (200, 50, 40)


def plot_trajectory(path: Path, title: str) -> Figure:
    """Draw a path of at least one pose: y over x at one scale, and z over the time gone."""
    figure = Figure(800, 800)
    figure.text(70, 28, title, 15, color=(20, 20, 20))
    plane = path.positions_xyz[:, :2]
    above = Axes(figure, (70, 68, 700, 460), plane.min(axis=0), plane.max(axis=0), equal=True)
    above.draw("x (m)", "y (m)")
    above.curve(plane, _WAY)
    for name, color, x, place in (
        ("start", _START, 650, above.places(plane[:1])[0]),
        ("end", _END, 715, above.places(plane[-1:])[0]),
    ):
        figure.dot(place[0], place[1], 5, color)
        figure.dot(x, 56, 4, color)
        figure.text(x + 9, 60, name)
    times_s = (path.stamps_ns - path.stamps_ns[0]) / 1e9
    heights = np.stack([times_s, path.positions_xyz[:, 2]], axis=1)
    over_time = Axes(figure, (70, 600, 700, 140), heights.min(axis=0), heights.max(axis=0))
    over_time.draw("time (s)", "z (m)")
    over_time.curve(heights, _WAY)
    return figure
