"""Derivatives of a picture: along a line, to the right and down, how large and where to."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.data import Image, Message, Pixels
from ros_visualise.lessons.drawing import BLUE, RED, YELLOW, by_direction, levels, titled
from ros_visualise.lessons.lesson import GIVES, TAKES, Lesson, Step, show, work_of
from ros_visualise.lessons.methods.sobel import central_difference, direction, magnitude, sobel
from ros_visualise.nodes import node
from ros_visualise.params import param
from ros_visualise.sinks.axes import Axes
from ros_visualise.sinks.figure import Figure
from ros_visualise.vision.edges import Aperture

_WIDTH, _CURVE = 640, 190


@dataclass(frozen=True)
class ProfileParams:
    """Along which line."""

    row: int = param(-1, "row of the picture; -1: the middle", min=-1, max=4096, slider=(-1, 480))


@node("profile", params=ProfileParams, inputs=TAKES, outputs=GIVES)
def profile(image: Image, params: ProfileParams) -> dict[str, Message]:
    """The gray along a row, and its derivative."""
    gray = cv2.cvtColor(work_of(image, np.ndarray), cv2.COLOR_BGR2GRAY)
    row = gray.shape[0] // 2 if params.row < 0 else min(params.row, gray.shape[0] - 1)
    slope = central_difference(gray[row])
    x = int(np.abs(slope).argmax())
    text = """
        Along row {row}, yellow, the gray is a curve, blue. Its derivative, red, says how fast it
        changes; between pixels there is nothing, so the difference of the neighbours is taken:

            f'(x) ≈ (f(x + 1) − f(x − 1)) / 2

        It is farthest from zero at an edge. Here that is {slope:+.1f} levels per pixel at x = {x},
        where the gray goes from {before} to {after}.
        """
    return show(
        image,
        _draw_profile(gray, row, slope),
        text,
        gray,
        row=row,
        slope=slope[x],
        x=x,
        before=int(gray[row, max(x - 1, 0)]),
        after=int(gray[row, min(x + 1, gray.shape[1] - 1)]),
    )


@dataclass(frozen=True)
class DerivativesParams:
    """How the derivatives are taken."""

    aperture: Aperture = param(Aperture.THREE, "width of Sobel's kernel, pixels")


@dataclass(frozen=True, eq=False)
class _Gradient:
    """To the right and down, (height, width) each."""

    dx: Pixels
    dy: Pixels


@node("derivatives", params=DerivativesParams, inputs=TAKES, outputs=GIVES)
def derivatives(image: Image, params: DerivativesParams) -> dict[str, Message]:
    """Gx and Gy: how fast the gray changes to the right, and down."""
    dx, dy = sobel(work_of(image, np.ndarray), params.aperture.value)
    top = float(max(np.abs(dx).max(), np.abs(dy).max(), 1))
    text = """
        A picture changes in two directions. Sobel's kernels differentiate along one and smooth
        along the other, so that noise does less harm:

                 −1  0  1
            Gx:  −2  0  2
                 −1  0  1

                 −1 −2 −1
            Gy:   0  0  0
                  1  2  1

        Gray is no change, white brighter to the right (down), black darker. The kernel of
        {aperture} x {aperture} gives Gx from {least_x} to {most_x} here, Gy from {least_y} to
        {most_y}.
        """
    shown = [(name, _signed(one, top)) for name, one in (("Gx", dx), ("Gy", dy))]
    return show(
        image,
        titled(shown, 2),
        text,
        _Gradient(dx, dy),
        aperture=params.aperture.value,
        least_x=dx.min(),
        most_x=dx.max(),
        least_y=dy.min(),
        most_y=dy.max(),
    )


@node("magnitude", inputs=TAKES, outputs=GIVES)
def size(image: Image, params: object) -> dict[str, Message]:
    """|G|: how fast it changes in the direction in which it changes most."""
    found = work_of(image, _Gradient)
    length = magnitude(found.dx, found.dy)
    y, x = np.unravel_index(length.argmax(), length.shape)
    text = """
        The two are the sides of an arrow, whose length is

            |G| = √(Gx² + Gy²)

        Its largest value is {largest:.1f}, at ({x}, {y}): √(({dx})² + ({dy})²). The mean is
        {mean:.1f}.
        """
    return show(
        image,
        levels(length),
        text,
        largest=length[y, x],
        x=x,
        y=y,
        dx=found.dx[y, x],
        dy=found.dy[y, x],
        mean=length.mean(),
    )


@node("direction", inputs=TAKES, outputs=GIVES)
def towards(image: Image, params: object) -> dict[str, Message]:
    """θ: where it gets brighter."""
    found = work_of(image, _Gradient)
    angle, length = direction(found.dx, found.dy), magnitude(found.dx, found.dy)
    weights = np.bincount((angle / 45 + 0.5).astype(int).ravel() % 8, length.ravel(), 8)
    text = """
        The arrow points to where it gets brighter, across the edge:

            θ = atan2(Gy, Gx)

        The colour is θ: red 0° (right), yellow-green 90° (down), cyan 180° (left), violet 270°
        (up); the brightness is √|G|. Weighted by |G|, most of this picture's gradient points to
        about {most}°, {share:.0f} % of it.
        """
    return show(
        image,
        by_direction(angle, length),
        text,
        most=45 * int(weights.argmax()),
        share=100 * weights.max() / max(weights.sum(), 1e-9),
    )


@dataclass(frozen=True)
class EdgesParams:
    """What counts as an edge."""

    threshold: int = param(100, "an edge is where |G| exceeds this",
                           min=0, max=100_000, slider=(0, 800))  # fmt: skip


@node("edges", params=EdgesParams, inputs=TAKES, outputs=GIVES)
def edges(image: Image, params: EdgesParams) -> dict[str, Message]:
    """A threshold on |G| gives edges."""
    found = work_of(image, _Gradient)
    is_edge = magnitude(found.dx, found.dy) > params.threshold
    text = """
        The simplest detector of edges: white where |G| > {threshold}. That is {share:.1f} % of
        the pixels. A low threshold keeps noise, a high one breaks edges, and where the gray
        changes slowly the edges are thick: Canny's method mends all three
        (ros-visualise explain canny).
        """
    seen = np.where(is_edge, np.uint8(255), np.uint8(0))
    return show(image, seen, text, threshold=params.threshold, share=100 * is_edge.mean())


LESSON = Lesson(
    "gradient",
    "what a gradient is: the gray along a line and its derivative, Gx and Gy, length and direction",
    """
    To a program a picture is a function: at each of {width} x {height} places a gray level. Where
    this function is steep there is an edge. These windows differentiate it: first along one line,
    then in both directions.
    """,
    [
        Step(profile),
        Step(derivatives),
        Step(size),
        Step(towards, after="derivatives"),
        Step(edges, after="derivatives"),
    ],
)


def _signed(values: Pixels, top: float) -> Pixels:
    """From -top to top as 0 to 255, 0 as 128."""
    shown: Pixels = np.rint(128 + values * (127 / top)).astype(np.uint8)
    return shown


def _draw_profile(gray: Pixels, row: int, slope: Pixels) -> Figure:
    """The picture with its row, and below it the gray and its derivative, at the same places."""
    shown = (_WIDTH - 70) * gray.shape[0] / gray.shape[1]
    figure = Figure(_WIDTH, round(shown + 2 * _CURVE))
    left, across = 60, _WIDTH - 70
    figure.picture((left, 0, across, shown), gray)
    place = shown * (row + 0.5) / gray.shape[0]
    figure.line(np.array([[left, place], [left + across, place]]), YELLOW, 2)
    x = np.arange(len(slope))
    curves = ((gray[row].astype(float), "f", BLUE), (slope, "f'", RED))
    for number, (values, name, color) in enumerate(curves):
        box = (left, shown + 26 + number * _CURVE, across, _CURVE - 66)
        points = np.stack([x, values], axis=1)
        axes = Axes(figure, box, points.min(axis=0), points.max(axis=0))
        axes.draw("x (pixels)", name)
        axes.curve(points, color)
    return figure
