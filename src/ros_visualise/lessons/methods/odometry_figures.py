"""Figures of visual odometry: corners, epipolar lines, points from above, the way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ros_visualise.data import Floats, Pixels
from ros_visualise.estimation.visual.stretch import VisualPose
from ros_visualise.geometry import se3
from ros_visualise.lessons.lesson import WIDTH
from ros_visualise.lessons.methods.homography import ellipse
from ros_visualise.lessons.methods.motion import ViewPair, clipped, distances
from ros_visualise.plotting.axes import PlotAxes
from ros_visualise.plotting.colors import BLUE, GREEN, ORANGE, PALETTE, RED, YELLOW
from ros_visualise.plotting.figure import Figure

_LINES = 8
_NEAR_PX = 2.0  # from its line, of a corner that is drawn
_ELLIPSES = 5
_AXES = (("to the right", 1), ("up", -1), ("ahead", 1))  # of a camera, and their signs


def picture_figure(bgr: Pixels, pictures: int = 1) -> Figure:
    """A figure of the width of texts with one picture, or with space for more below it."""
    height = round(WIDTH * bgr.shape[0] / bgr.shape[1])
    figure = Figure(WIDTH, max(height, 1) * pictures + 24 * (pictures - 1))
    figure.picture((0, 0, WIDTH, max(height, 1)), bgr, (0, 0))
    return figure


def draw_dots(bgr: Pixels, pixels_uv: Floats) -> Figure:
    """A picture with dots at pixels (N, 2)."""
    figure = picture_figure(bgr)
    for x, y in (pixels_uv + 0.5) * WIDTH / bgr.shape[1]:
        figure.dot(x, y, 3, GREEN)
    return figure


def draw_flow(bgr: Pixels, pixels_uv: Floats, motions: Floats) -> Figure:
    """A picture with arrows (N, 2) at pixels (N, 2)."""
    figure = picture_figure(bgr)
    scale = WIDTH / bgr.shape[1]
    for start, way in zip(pixels_uv, motions, strict=True):
        figure.arrow((start + 0.5) * scale, (start + way + 0.5) * scale, YELLOW, 1.5)
    return figure


def draw_lines(first: Pixels, second: Pixels, pair: ViewPair, lines: Floats) -> Figure:
    """The first view with corners, and below it the second one with their lines."""
    figure = picture_figure(first, 2)
    height, width = first.shape[:2]
    scale = WIDTH / width
    below = figure.height - round(scale * height)
    figure.picture((0, below, WIDTH, figure.height - below), second, (0, 0))
    figure.text(0, below - 7, "the first view, with the second one below it", 13)
    for number, one in enumerate(_spread(pair, distances(lines, pair.second_uv))):
        color = PALETTE[number % len(PALETTE)]
        x, y = (pair.first_uv[one] + 0.5) * scale
        figure.dot(x, y, 5, color)
        ends = clipped(lines[one], width, height)
        if ends is not None:
            figure.line((ends + 0.5) * scale + [0, below], color, 2)
        x, y = (pair.second_uv[one] + 0.5) * scale
        figure.dot(x, below + y, 5, color)
    for x, y in (pair.second_uv[~pair.motion.agree] + 0.5) * scale:
        figure.dot(x, below + y, 2, RED)
    return figure


def draw_world(pair: ViewPair, points: Floats, factor: float) -> Figure:
    """Points and cameras from above: x to the right, z ahead; of two sizes."""
    figure = Figure(WIDTH, 480)
    R, t, _ = pair.motion
    cameras = np.stack([np.zeros(3), -R.T @ t])
    every = np.concatenate([k * one for one in (points, cameras) for k in (1.0, factor)])[:, [0, 2]]
    box = (60, 30, WIDTH - 80, 390)
    axes = PlotAxes(figure, box, every.min(axis=0), every.max(axis=0), equal=True)
    axes.draw("to the right (steps)", "ahead (steps)")
    for k, color in ((factor, ORANGE), (1.0, BLUE)):
        for x, y in axes.places(k * points[:, [0, 2]]):
            figure.dot(x, y, 2, color)
        for x, y in axes.places(k * cameras[:, [0, 2]]):
            figure.dot(x, y, 5, color)
    return figure


def draw_way(poses: Sequence[VisualPose]) -> Figure:
    """The way in the plane of its two longest directions, with ellipses."""
    figure = Figure(WIDTH, 480)
    places = np.array([one.p for one in poses])
    axes = sorted(np.argsort(-np.ptp(places, axis=0))[:2])
    if axes == [1, 2]:
        axes = [2, 1]  # what is up is drawn upwards
    signs = np.array([_AXES[n][1] for n in axes])
    path = places[:, axes] * signs
    around = []
    for n in np.linspace(0, len(poses) - 1, _ELLIPSES + 1).round().astype(int)[1:]:
        change = se3.about_itself(poses[n].p)
        spread = (change @ poses[n].covariance @ change.T)[np.ix_(axes, axes)]
        around.append(path[n] + ellipse(spread * np.outer(signs, signs), 2))
    every = np.concatenate([path, *around])
    box = (60, 30, WIDTH - 80, 390)
    plot = PlotAxes(figure, box, every.min(axis=0), every.max(axis=0), equal=True)
    plot.draw(*(f"{_AXES[n][0]} (first steps)" for n in axes))
    for line in around:
        plot.curve(line, RED, 1.2)
    plot.curve(path, BLUE, 2.5)
    for (x, y), color in zip(plot.places(path[[0, -1]]), (GREEN, BLUE), strict=True):
        figure.dot(x, y, 5, color)
    return figure


def _spread(pair: ViewPair, away: Floats) -> list[int]:
    """Some corners that agree, far from each other."""
    good = np.flatnonzero(pair.motion.agree & (away < _NEAR_PX))
    if not len(good):
        return []
    chosen = [int(good[0])]
    while len(chosen) < min(_LINES, len(good)):
        apart = pair.second_uv[good][:, None] - pair.second_uv[chosen]
        chosen.append(int(good[np.linalg.norm(apart, axis=2).min(axis=1).argmax()]))
    return chosen
