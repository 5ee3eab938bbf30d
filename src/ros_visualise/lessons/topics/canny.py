"""Canny's edges, step by step."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Image, Message, Pixels
from ros_visualise.lessons.lesson import GIVES, TAKES, Lesson, Step, show, work_of
from ros_visualise.lessons.magnifier import PixelParams, magnified
from ros_visualise.lessons.methods import canny
from ros_visualise.lessons.methods.canny import NEIGHBOURS, Edges, Gradient, Mask
from ros_visualise.lessons.methods.sobel import direction
from ros_visualise.nodes import node
from ros_visualise.plotting.colors import BLUE, GREEN, ORANGE, RED, by_direction, levels
from ros_visualise.plotting.figure import Figure
from ros_visualise.vision.color import bgr_of
from ros_visualise.vision.edges import Aperture, smooth

_REACH = 3


@dataclass(frozen=True)
class SmoothingParams:
    """Strength of the smoothing."""

    sigma: float = param(1.0, "standard deviation of the Gaussian, pixels; 0 is off",
                         min=0, max=20, slider=(0, 5))  # fmt: skip


@node("smoothing", params=SmoothingParams, inputs=TAKES, outputs=GIVES)
def smoothing(image: Image, params: SmoothingParams) -> dict[str, Message]:
    """Step 1: gray, smoothed by a Gaussian."""
    gray = cv2.cvtColor(bgr_of(image), cv2.COLOR_BGR2GRAY)
    smoothed = smooth(gray, params.sigma)
    change = float(np.abs(gray.astype(int) - smoothed).mean())
    text = f"""
        Derivatives amplify noise, so the picture is smoothed first: each pixel becomes the mean of
        its neighbours, weighted by a Gaussian.

            G(x, y) = exp(-r² / 2σ²) / 2πσ²
            r² = x² + y²,   σ = {params.sigma:g}

        This changes a pixel of this picture by {change:.2f} gray levels on average. cv2.Canny does
        not smooth, so give it a smoothed picture. With σ = 0 this step is off.
        """
    return show(image, smoothed, text, smoothed)


@dataclass(frozen=True)
class GradientParams:
    """Measurement of the gradient."""

    aperture: Aperture = param(Aperture.THREE, "width of the Sobel kernel, pixels")
    l2: bool = param(False, "use √(Gx² + Gy²), which is more exact, instead of |Gx| + |Gy|")


@node("gradient", params=GradientParams, inputs=TAKES, outputs=GIVES)
def gradient(image: Image, params: GradientParams) -> dict[str, Message]:
    """Step 2: how fast the gray level changes, and in which direction."""
    found = canny.gradient(work_of(image, np.ndarray), params.aperture.value, params.l2)
    size = _norm(found)
    y, x = np.unravel_index(size.argmax(), size.shape)
    text = f"""
        Sobel's kernels measure how fast the gray changes to the right, Gx, and down, Gy. For 3x3:

                 −1  0  1             −1 −2 −1
            Gx:  −2  0  2       Gy:    0  0  0
                 −1  0  1              1  2  1

            |G| = {"√(Gx² + Gy²)" if params.l2 else "|Gx| + |Gy|"},   θ = atan2(Gy, Gx)

        {_about_kernel(params.aperture.value)}The colour is the direction θ, the brightness √|G|.
        The largest |G| here is {size[y, x]:.0f}, at ({x}, {y}): Gx = {found.dx[y, x]}, Gy =
        {found.dy[y, x]}, θ = {direction(found.dx[y, x], found.dy[y, x]):.0f}°.
        """
    return show(image, by_direction(direction(found.dx, found.dy), size), text, found)


@dataclass(frozen=True, eq=False)
class _Thin:
    """The gradient, and where it is a maximum."""

    gradient: Gradient
    keeps: Mask


@node("suppression", params=PixelParams, inputs=TAKES, outputs=GIVES)
def suppression(image: Image, params: PixelParams) -> dict[str, Message]:
    """Step 3: only maxima along the gradient stay, so that edges are one pixel wide."""
    found = work_of(image, Gradient)
    keeps = canny.is_maximum(found)
    size = _norm(found)
    row, column = np.unravel_index(size.argmax(), size.shape)
    x, y = params.pixel(size.shape, (int(column), int(row)))
    kind = int(canny.direction_class(found)[y, x])
    towards = NEIGHBOURS[kind]
    neighbours = [_at(size, x + s * towards[0], y + s * towards[1]) for s in (-1, 1)]
    text = f"""
        A pixel stays only if its |G| is larger than that of its two neighbours in the direction of
        the gradient; θ is rounded to 0°, 45°, 90° or 135°. If two are equal, the left or upper one
        stays; on a diagonal, neither of them stays, as in cv2.Canny.

        At ({x}, {y}), blue: |G| = {size[y, x]:.0f}, θ =
        {direction(found.dx[y, x], found.dy[y, x]):.0f}°, rounded to {45 * kind}°. Its two
        neighbours, orange, have {neighbours[0]:.0f} and {neighbours[1]:.0f}, so the pixel
        {"stays" if keeps[y, x] else "is suppressed"}.

        Of {int((size > 0).sum())} pixels with a gradient, {int(keeps.sum())} stay
        ({100 * keeps.sum() / max(1, int((size > 0).sum())):.1f} %). Click another pixel.
        """
    return show(image, _draw_suppression(found, keeps, (x, y), towards), text, _Thin(found, keeps))


@dataclass(frozen=True)
class HysteresisParams:
    """The two thresholds."""

    low: int = param(60, "lower threshold of |G|", min=0, max=4000, slider=(0, 800))
    high: int = param(140, "upper threshold of |G|", min=0, max=4000, slider=(0, 800))


@dataclass(frozen=True, eq=False)
class _Sorted:
    """The gradient, and the edges by two thresholds."""

    gradient: Gradient
    edges: Edges
    params: HysteresisParams


@node("thresholds", params=HysteresisParams, inputs=TAKES, outputs=GIVES)
def thresholds(image: Image, params: HysteresisParams) -> dict[str, Message]:
    """Step 4: strong edges, weak edges, and the rest."""
    thin = work_of(image, _Thin)
    edges = canny.hysteresis(thin.gradient, thin.keeps, params.low, params.high)
    weak = edges.rescued | edges.lost
    low, high = sorted((params.low, params.high))
    text = f"""
        Two thresholds sort the remaining pixels:

            strong:  |G| > {high}
            weak:    {low} < |G| ≤ {high}

        Here {int(edges.strong.sum())} pixels are strong (white) and {int(weak.sum())} are weak
        (orange). The other {int(thin.keeps.sum() - edges.strong.sum() - weak.sum())} are not edges.
        """
    return show(
        image,
        _colored([(edges.strong, (255, 255, 255)), (weak, ORANGE)]),
        text,
        _Sorted(thin.gradient, edges, params),
    )


@node("hysteresis", inputs=TAKES, outputs=GIVES)
def hysteresis(image: Image, params: object) -> dict[str, Message]:
    """Step 5: weak edges stay if they are connected to strong ones."""
    found = work_of(image, _Sorted)
    edges = found.edges
    theirs = canny.opencv_edges(found.gradient, found.params.low, found.params.high)
    differ = int((theirs != edges.pixels).sum())
    masks = [(edges.strong, (255, 255, 255)), (edges.rescued, (90, 220, 90)), (edges.lost, RED)]
    text = f"""
        A weak pixel is kept if a chain of weak neighbours connects it to a strong one; the others
        count as noise. {int(edges.rescued.sum())} are kept (green), {int(edges.lost.sum())} are not
        (red).

        So {int((edges.pixels > 0).sum())} pixels are edges. cv2.Canny, given the same smoothed
        picture, differs in {differ} of {theirs.size} pixels.
        """
    return show(image, _colored(masks), text)


LESSON = Lesson(
    "canny",
    "how Canny's method finds edges one pixel wide: its five steps, and one pixel in detail",
    """
    An edge is where the gray changes quickly. Canny wanted three things from an edge detector: that
    it misses no edge and invents none, that it finds edges exactly where they are, and that it
    finds each edge only once. His method (1986) has five steps: smooth, differentiate, thin, apply
    two thresholds, and follow the edges.

    Each image shows one step on this picture of {width} x {height} pixels. Move the sliders of a
    step, and all later steps change too.
    """,
    [Step(smoothing), Step(gradient), Step(suppression), Step(thresholds), Step(hysteresis)],
)


def _norm(found: Gradient) -> Pixels:
    """The magnitude of the gradient, float; in L2 the root of the compared value."""
    size: Pixels = np.sqrt(found.size) if found.is_l2 else found.size.astype(float)
    return size


def _about_kernel(aperture: int) -> str:
    """A remark on other kernels than the one that is printed."""
    if aperture == 3:
        return ""
    divided = ", and its sums are divided by 16, as in cv2.Canny" if aperture == 7 else ""
    return f"Here the kernel has {aperture} x {aperture} numbers{divided}. "


def _at(size: Pixels, x: int, y: int) -> float:
    """The gradient at a pixel; 0 outside the picture."""
    is_inside = 0 <= x < size.shape[1] and 0 <= y < size.shape[0]
    return float(size[y, x]) if is_inside else 0.0


def _draw_suppression(
    found: Gradient, keeps: Mask, pixel: tuple[int, int], towards: tuple[int, int]
) -> Figure:
    """The gradient of the whole picture, what is left of it, and |G| around one pixel."""
    (x, y), size = pixel, _norm(found)
    stays = np.where(keeps, size, 0)
    figure, zoom = magnified([levels(np.sqrt(size)), levels(np.sqrt(stays))], pixel, _REACH)
    zoom.draw(levels(size), size)
    for sign in (-1, 1):
        zoom.mark(x + sign * towards[0], y + sign * towards[1], ORANGE)
    zoom.mark(x, y, BLUE)
    along = np.array([found.dx[y, x], found.dy[y, x]], float)
    along *= 2.5 / max(float(np.linalg.norm(along)), 1.0)
    figure.arrow(zoom.place(x, y), zoom.place(x + along[0], y + along[1]), GREEN)
    return figure


def _colored(masks: list[tuple[Mask, tuple[int, int, int]]]) -> Pixels:
    """Masks in colours (red, green, blue) on black, as BGR."""
    picture = np.zeros((*masks[0][0].shape, 3), np.uint8)
    for mask, color in masks:
        picture[mask] = color[::-1]
    return picture
