"""Derivatives of a picture: along a line, in two directions, magnitude and direction."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Floats, Image, Message, Pixels
from ros_visualise.lessons.lesson import GIVES, TAKES, WIDTH, Lesson, Step, show, work_of
from ros_visualise.lessons.magnifier import PixelParams
from ros_visualise.lessons.methods.sobel import (
    Whole,
    central_difference,
    direction,
    magnitude,
    sobel,
    sobel_kernels,
)
from ros_visualise.nodes import node
from ros_visualise.plotting.axes import PlotAxes
from ros_visualise.plotting.colors import BLUE, ORANGE, RED, YELLOW, by_direction, levels
from ros_visualise.plotting.figure import Figure, picture_grid
from ros_visualise.vision.edges import Aperture

_BAND, _CURVE, _GAP = 120, 84, 40


@node("profile", params=PixelParams, inputs=TAKES, outputs=GIVES)
def profile(image: Image, params: PixelParams) -> dict[str, Message]:
    """The gray level along a row, and its derivative."""
    gray = cv2.cvtColor(work_of(image, np.ndarray), cv2.COLOR_BGR2GRAY)
    height, width = gray.shape
    row = height // 2 if params.y < 0 else min(params.y, height - 1)
    slope = central_difference(gray[row])
    steepest = int(np.abs(slope).argmax())
    x = steepest if params.x < 0 else min(params.x, width - 1)
    text = f"""
        Along row {row} (yellow) the gray levels are a curve f (blue). Its derivative (red) is
        how fast it changes. A picture has no values between two pixels, so the derivative is half
        the difference between the two neighbours:

            f'(x) ≈ (f(x + 1) − f(x − 1)) / 2

        At x = {x} (orange): ({int(gray[row, min(x + 1, width - 1)])} −
        {int(gray[row, max(x - 1, 0)])}) / 2 = {slope[x]:+.1f} levels per pixel. In this row it is
        farthest from zero at x = {steepest}, with {slope[steepest]:+.1f}: there is an edge. Click
        another pixel.
        """
    return show(image, _draw_profile(gray, (x, row), slope), text, gray)


@dataclass(frozen=True)
class DerivativesParams:
    """Kernel of the derivatives."""

    aperture: Aperture = param(Aperture.THREE, "width of the Sobel kernel, pixels")


@dataclass(frozen=True, eq=False)
class _Gradient:
    """Derivatives to the right and down, (height, width) each."""

    dx: Pixels
    dy: Pixels


@node("derivatives", params=DerivativesParams, inputs=TAKES, outputs=GIVES)
def derivatives(image: Image, params: DerivativesParams) -> dict[str, Message]:
    """Gx and Gy: how fast the gray level changes to the right and downwards."""
    dx, dy = sobel(work_of(image, np.ndarray), params.aperture.value)
    smoothing, deriving = sobel_kernels(params.aperture.value)
    top = float(max(np.abs(dx).max(), np.abs(dy).max(), 1))
    text = """
        A picture can change in two directions. Each of Sobel's kernels differentiates along one
        direction, and smooths along the other, so that noise does less harm:

            Gx:
        {kernel_x}

            Gy:
        {kernel_y}

        Gray means no change; white means that it gets brighter to the right (Gy: downwards), black
        that it gets darker. Here the {aperture} x {aperture} kernels give Gx from {least_x} to
        {most_x}, Gy from {least_y} to {most_y}.
        """
    shown = [(name, _signed(one, top)) for name, one in (("Gx", dx), ("Gy", dy))]
    return show(
        image,
        picture_grid(shown, 2),
        text,
        _Gradient(dx, dy),
        kernel_x=_printed(np.outer(smoothing, deriving)),
        kernel_y=_printed(np.outer(deriving, smoothing)),
        aperture=params.aperture.value,
        least_x=dx.min(),
        most_x=dx.max(),
        least_y=dy.min(),
        most_y=dy.max(),
    )


@node("magnitude", inputs=TAKES, outputs=GIVES)
def size(image: Image, params: object) -> dict[str, Message]:
    """|G|: how fast the gray level changes in the direction of steepest change."""
    found = work_of(image, _Gradient)
    length = magnitude(found.dx, found.dy)
    y, x = np.unravel_index(length.argmax(), length.shape)
    text = f"""
        Gx and Gy are the two components of an arrow, the gradient. Its length is

            |G| = √(Gx² + Gy²)

        The largest length is √(({found.dx[y, x]})² + ({found.dy[y, x]})²) = {length[y, x]:.1f}, at
        ({x}, {y}). The mean is {length.mean():.1f}.
        """
    return show(image, levels(length), text)


@node("direction", inputs=TAKES, outputs=GIVES)
def towards(image: Image, params: object) -> dict[str, Message]:
    """θ: the direction in which the picture gets brighter."""
    found = work_of(image, _Gradient)
    angle, length = direction(found.dx, found.dy), magnitude(found.dx, found.dy)
    weights = np.bincount((angle / 45 + 0.5).astype(int).ravel() % 8, length.ravel(), 8)
    text = f"""
        The gradient points to where the picture gets brighter, across the edge:

            θ = atan2(Gy, Gx)

        The colour is θ: red 0° (right), yellow-green 90° (down), cyan 180° (left), violet 270°
        (up); the brightness is √|G|. Of eight directions, {45 * int(weights.argmax())}° is the most
        common in this picture: {100 * weights.max() / max(weights.sum(), 1e-9):.0f} % of the
        gradient, weighted by |G|, points there.
        """
    return show(image, by_direction(angle, length), text)


@dataclass(frozen=True)
class EdgesParams:
    """Threshold for edges."""

    threshold: int = param(100, "a pixel whose |G| is above this threshold is an edge",
                           min=0, max=100_000, slider=(0, 800))  # fmt: skip


@node("edges", params=EdgesParams, inputs=TAKES, outputs=GIVES)
def edges(image: Image, params: EdgesParams) -> dict[str, Message]:
    """A threshold on |G| gives edges."""
    found = work_of(image, _Gradient)
    is_edge = magnitude(found.dx, found.dy) > params.threshold
    seen = np.where(is_edge, np.uint8(255), np.uint8(0))
    text = f"""
        The simplest edge detector: a pixel is white where |G| > {params.threshold}. That is
        {100 * is_edge.mean():.1f} % of the pixels. A low threshold keeps noise, a high one breaks
        edges, and where the gray changes slowly, edges are thick. Canny's method solves all three
        problems (ros-visualise explain canny).
        """
    return show(image, seen, text)


LESSON = Lesson(
    "gradient",
    "what a gradient is: the gray along a line and its derivative, Gx and Gy, length and direction",
    """
    For a program a picture is a function: it has a gray level at each of {width} x {height} points.
    Where this function is steep, there is an edge. These images differentiate it: first along one
    line, then in both directions.
    """,
    [
        Step(profile),
        Step(derivatives),
        Step(size),
        Step(towards, after="derivatives"),
        Step(edges, after="derivatives"),
    ],
)


def _printed(kernel: Whole) -> str:
    """The numbers of a kernel, in lines of a formula."""
    width = len(f"{kernel.min()}") + 1
    rows = ("".join(f"{number:{width}}" for number in row) for row in kernel)
    return "\n".join("        " + row for row in rows).replace("-", "−")


def _signed(values: Pixels, top: float) -> Pixels:
    """Values from -top to top as 0 to 255, 0 as 128."""
    shown: Pixels = np.rint(128 + values * (127 / top)).astype(np.uint8)
    return shown


def _draw_profile(gray: Pixels, pixel: tuple[int, int], slope: Floats) -> Figure:
    """A band of the picture around a row, and below it the gray and its derivative.

    Args:
        gray: the picture.
        pixel: (x, y) of the pixel to look at.
        slope: of the row.
    """
    at, row = pixel
    left, across = 60, WIDTH - 70
    scale = across / gray.shape[1]
    rows = min(gray.shape[0], max(round(_BAND / scale), 1))
    first = min(max(row - rows // 2, 0), gray.shape[0] - rows)
    shown = scale * rows
    figure = Figure(WIDTH, round(shown + 2 * _CURVE + 2 * _GAP + 24))
    band = np.ascontiguousarray(gray[first : first + rows])
    figure.picture((left, 0, across, shown), band, (0, first))
    place = scale * (row - first + 0.5)
    figure.line(np.array([[left, place], [left + across, place]]), YELLOW, 2)
    figure.dot(left + scale * (at + 0.5), place, 4, ORANGE)
    x = np.arange(len(slope))
    curves = ((gray[row].astype(float), "f", BLUE), (slope, "f'", RED))
    for number, (values, name, color) in enumerate(curves):
        box = (left, shown + 24 + number * (_CURVE + _GAP), across, _CURVE)
        points = np.stack([x, values], axis=1)
        axes = PlotAxes(figure, box, points.min(axis=0), points.max(axis=0))
        axes.draw("x (pixels)" if number else "", name)
        axes.curve(points, color)
        axes.vertical(at, values.max(), ORANGE, values.min())
    return figure
