"""Thresholds: the five types on the tone curve, Otsu's on the histogram, one for each window."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Image, Message, Pixels
from ros_visualise.lessons.lesson import GIVES, TAKES, WIDTH, Lesson, Step, show, work_of
from ros_visualise.lessons.methods.thresholds import LEVELS, between_classes, otsu, tone_curves
from ros_visualise.nodes import node
from ros_visualise.plotting.axes import PlotAxes, draw_histogram
from ros_visualise.plotting.colors import BLUE, GREEN, RED
from ros_visualise.plotting.figure import Figure
from ros_visualise.vision.threshold import adaptive

_TALL = 130  # height of the separated picture


@node("histogram", inputs=TAKES, outputs=GIVES)
def histogram(image: Image, params: object) -> dict[str, Message]:
    """Histogram: how often each gray level occurs."""
    gray = cv2.cvtColor(work_of(image, np.ndarray), cv2.COLOR_BGR2GRAY)
    counts = np.bincount(gray.ravel(), minlength=256)
    figure = Figure(WIDTH, 360)
    draw_histogram(figure, (70, 30, WIDTH - 90, 270), gray)
    text = f"""
        A threshold compares gray levels, so first look at how often each level occurs: the
        histogram. This picture's levels go from {gray.min()} to {gray.max()}, with a mean of
        {gray.mean():.1f}; the most frequent one is {counts.argmax()}, with {counts.max()} pixels.
        If the histogram has two hills, a threshold in the valley between them separates dark
        objects from bright ones.
        """
    return show(image, figure, text, gray)


@dataclass(frozen=True)
class TypesParams:
    """The threshold."""

    level: int = param(128, "the threshold T", min=0, max=255)


@node("types", params=TypesParams, inputs=TAKES, outputs=GIVES)
def types(image: Image, params: TypesParams) -> dict[str, Message]:
    """Five types of threshold, each with its tone curve."""
    gray = work_of(image, np.ndarray)
    seen = _draw_types(gray, params.level)
    text = f"""
        OpenCV has five types of threshold. With T = {params.level}, each of them changes a level v
        as follows:

            binary             255 if v > T, else 0
            binary inverted    0 if v > T, else 255
            truncate           T if v > T, else v
            to zero            v if v > T, else 0
            to zero inverted   0 if v > T, else v

        A level equal to T counts as below. {100 * (gray > params.level).mean():.1f} % of the pixels
        are above T.
        """
    return show(image, seen, text)


@node("otsu", inputs=TAKES, outputs=GIVES)
def by_otsu(image: Image, params: object) -> dict[str, Message]:
    """Otsu's threshold: the one that separates the levels best."""
    gray = work_of(image, np.ndarray)
    counts = np.bincount(gray.ravel(), minlength=256)
    level = otsu(counts)
    theirs, _ = cv2.threshold(gray, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    is_above = gray > level
    text = f"""
        A threshold t splits the pixels into two classes. Otsu (1979) takes the t for which the
        variance between the classes is largest (green, below the histogram; ω: share of the pixels,
        μ: mean level of a class):

            σ²(t) = ω₀ ω₁ (μ₀ − μ₁)²

        Here t = {level} (cv2.threshold finds {theirs:.0f}). {100 * (1 - is_above.mean()):.1f} % of
        the pixels are below, with a mean of {_mean(gray[~is_above]):.1f}; the mean of those above
        is {_mean(gray[is_above]):.1f}. σ² is {between_classes(counts).max():.0f}, out of a total
        variance of {gray.var():.0f}.
        """
    return show(image, _draw_otsu(gray, level), text)


@dataclass(frozen=True)
class AdaptiveParams:
    """The window that a pixel is compared with."""

    size: int = param(31, "width of the window, pixels; even values are rounded up to odd",
                      min=3, max=255, slider=(3, 101))  # fmt: skip
    offset: int = param(5, "the threshold is the window's mean minus this", min=-255, max=255,
                        slider=(-20, 40))  # fmt: skip


@node("adaptive", params=AdaptiveParams, inputs=TAKES, outputs=GIVES)
def by_window(image: Image, params: AdaptiveParams) -> dict[str, Message]:
    """A separate threshold for each pixel."""
    gray = work_of(image, np.ndarray)
    size = params.size | 1
    seen = adaptive(gray, False, size, params.offset)
    share = 100 * (seen > 0).mean()
    text = f"""
        Where the light is uneven, no single threshold fits everywhere. So each pixel is compared
        with the mean of the {size} x {size} pixels around it:

            255 if v > mean − {params.offset}, else 0

        {share:.1f} % of the pixels become white.
        """
    return show(image, seen, text)


LESSON = Lesson(
    "threshold",
    "what a threshold does to a picture: five types, Otsu's choice, and a threshold for each pixel",
    """
    A threshold decides by the gray level alone: bright or dark, object or background. It is the
    oldest way to find objects in a picture. This picture has {width} x {height} pixels.
    """,
    [Step(histogram), Step(types), Step(by_otsu, "histogram"), Step(by_window, "histogram")],
)


def _mean(levels: Pixels) -> float:
    """Mean level; 0 for no pixels."""
    return float(levels.mean()) if levels.size else 0.0


def _draw_types(gray: Pixels, level: int) -> Figure:
    """Two in a row, each with its curve beside it; the picture itself comes first."""
    curves = {"gray": LEVELS.astype(np.uint8)} | tone_curves(level)
    cell = WIDTH / 2
    side = 110
    shown = cell - side - 16
    row = max(shown * gray.shape[0] / gray.shape[1], side) + 40
    figure = Figure(WIDTH, round(3 * row))
    for number, (name, curve) in enumerate(curves.items()):
        left, top = (number % 2) * cell + 4, (number // 2) * row
        figure.text(left, top + 17, name, 13)
        height = shown * gray.shape[0] / gray.shape[1]
        figure.picture((left, top + 24, shown, height), cv2.LUT(gray, curve))
        box = (left + shown + 6, top + 24, side - 4, side - 4)
        axes = PlotAxes(figure, box, np.zeros(2), np.full(2, 255.0))
        corners = np.array([[0, 0], [255, 0], [255, 255], [0, 255], [0, 0]], float)
        axes.curve(corners, (200, 200, 200), 1)
        axes.curve(np.stack([LEVELS, curve], axis=1).astype(float), BLUE, 2)
    return figure


def _draw_otsu(gray: Pixels, level: int) -> Figure:
    """The separated picture, its histogram with the threshold, and Otsu's measure."""
    counts = np.bincount(gray.ravel(), minlength=256)
    across = WIDTH - 90
    scale = min(across / gray.shape[1], _TALL / gray.shape[0])
    shown, wide = scale * gray.shape[0], scale * gray.shape[1]
    figure = Figure(WIDTH, round(shown + 290))
    is_above = np.where(gray > level, np.uint8(255), np.uint8(0))
    figure.picture((70 + (across - wide) / 2, 0, wide, shown), is_above)
    axes = draw_histogram(figure, (70, shown + 26, across, 80), gray)
    axes.vertical(level, counts.max(), RED)
    measure = between_classes(counts)
    box = (70, shown + 170, across, 80)
    below = PlotAxes(figure, box, np.zeros(2), np.array([255.0, measure.max()]))
    below.draw("threshold t", "variance between the classes")
    below.curve(np.stack([LEVELS, measure], axis=1), GREEN)
    below.vertical(level, measure.max(), RED)
    return figure
