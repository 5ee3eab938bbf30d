"""Images: pixels, channels, levels, encodings."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import ENCODINGS, Image, Message
from ros_visualise.lessons.lesson import GIVES, TAKES, WIDTH, Lesson, Step, show, work_of
from ros_visualise.lessons.magnifier import PixelParams, magnified
from ros_visualise.lessons.methods.quality import entropy, psnr, quantize
from ros_visualise.nodes import node
from ros_visualise.plotting.axes import PlotAxes, draw_histogram
from ros_visualise.plotting.colors import BLUE, GREEN, RED, YELLOW
from ros_visualise.plotting.figure import Figure, picture_grid

_REACH = 4
_ENCODED = ("mono8", "mono16", "bgr8", "rgb8", "bgra8", "bgr16", "bayer_rggb8")


@node("pixels", params=PixelParams, inputs=TAKES, outputs=GIVES)
def pixels(image: Image, params: PixelParams) -> dict[str, Message]:
    """Pixels: a grid of numbers."""
    bgr = work_of(image, np.ndarray)
    gray = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)
    height, width = gray.shape
    x, y = params.pixel(gray.shape, (width // 2, height // 2))
    figure, zoom = magnified([bgr, gray], (x, y), _REACH)
    zoom.draw(bgr, gray)
    zoom.mark(x, y, YELLOW)
    blue, green, red = bgr[y, x]
    text = f"""
        A picture is a grid of {width} columns and {height} rows: {gray.size} pixels. Column 0 and
        row 0 are at the top left. Each pixel here has three 8-bit numbers: how much blue, green and
        red there is. At ({x}, {y}) these are blue {blue}, green {green}, red {red}. In gray they
        become one number, {gray[y, x]}; the figure shows this number for each pixel. Click another
        pixel.

            {width} × {height} pixels
            × 3 channels × 1 byte = {bgr.nbytes} bytes
        """
    return show(image, figure, text)


@node("channels", inputs=TAKES, outputs=GIVES)
def channels(image: Image, params: object) -> dict[str, Message]:
    """Channels: a picture for each colour."""
    bgr = work_of(image, np.ndarray)
    named = list(zip(("blue", "green", "red"), cv2.split(bgr), strict=True))
    table = "\n".join(f"    {name:6} mean {one.mean():6.1f}   from {one.min():3} to {one.max():3}"
                      for name, one in named)  # fmt: skip
    text = f"""
A colour picture is made of three gray ones, its channels, one for each colour. OpenCV keeps them in
the order blue, green, red; most other programs begin with red.

{table}
"""
    return show(image, picture_grid([("in colours", bgr), *named], 2), text)


@dataclass(frozen=True)
class LevelsParams:
    """Number of levels."""

    bits: int = param(3, "number of bits k per gray level", min=1, max=8)


@node("gray_levels", params=LevelsParams, inputs=TAKES, outputs=GIVES)
def gray_levels(image: Image, params: LevelsParams) -> dict[str, Message]:
    """k bits give 2ᵏ gray levels."""
    gray = cv2.cvtColor(work_of(image, np.ndarray), cv2.COLOR_BGR2GRAY)
    fewer = quantize(gray, params.bits)
    height, width = gray.shape
    quality = psnr(fewer, gray)
    text = f"""
        With k bits a pixel can have 2ᵏ levels:

            2^{params.bits} = {2**params.bits} levels
            {width} × {height} × {params.bits} / 8 = {gray.size * params.bits / 8:.0f} bytes

        Fewer levels need less memory, but where the gray changes slowly you see steps. Compared
        with 8 bits, this picture has a PSNR (how near it is to the original) of {quality:.1f} dB;
        each additional bit adds about 6 dB. {len(np.unique(fewer))} of the {2**params.bits} levels
        are used.
        """
    return show(image, fewer, text)


@node("histogram", inputs=TAKES, outputs=GIVES)
def histogram(image: Image, params: object) -> dict[str, Message]:
    """The histogram: how often each level occurs."""
    bgr = work_of(image, np.ndarray)
    gray = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)
    figure = Figure(WIDTH, 400)
    draw_histogram(figure, (60, 26, WIDTH - 80, 120), gray)
    counts = [np.bincount(one.ravel(), minlength=256) for one in cv2.split(bgr)]
    top = np.array([255.0, max(count.max() for count in counts)])
    axes = PlotAxes(figure, (60, 226, WIDTH - 80, 120), np.zeros(2), top)
    axes.draw("level", "pixels per channel")
    for count, color in zip(counts, (BLUE, GREEN, RED), strict=True):
        axes.curve(np.stack([np.arange(256), count], axis=1).astype(float), color)
    text = f"""
        The histogram counts how many pixels have each level: above for the gray picture, below for
        the three channels. The mean, {gray.mean():.1f}, is the brightness; the standard deviation,
        {gray.std():.1f}, is the contrast. If all levels were equally frequent, each pixel would
        carry 8 bits of information. Here it carries less, the entropy

            H = −Σ p(v) log₂ p(v) = {entropy(gray):.2f} bits
        """
    return show(image, figure, text)


@dataclass(frozen=True)
class ResolutionParams:
    """Reduction of the resolution."""

    factor: int = param(
        8, "side of each block that becomes one pixel, in pixels", min=1, max=64, slider=(1, 32)
    )


@node("resolution", params=ResolutionParams, inputs=TAKES, outputs=GIVES)
def resolution(image: Image, params: ResolutionParams) -> dict[str, Message]:
    """Resolution: the number of pixels for the same object."""
    bgr = work_of(image, np.ndarray)
    height, width = bgr.shape[:2]
    size = max(1, width // params.factor), max(1, height // params.factor)
    small = cv2.resize(bgr, size, interpolation=cv2.INTER_AREA)
    large = cv2.resize(small, (width, height), interpolation=cv2.INTER_NEAREST)
    text = f"""
        Each block of {params.factor} × {params.factor} pixels is replaced by one pixel, their mean.
        Of the {width} × {height} pixels, {size[0]} × {size[1]} remain:
        {100 * small.size / bgr.size:.2f} % of the bytes. Details smaller than two of the new pixels
        are lost, and enlarging the picture does not bring them back.
        """
    return show(image, large, text)


@node("encodings", inputs=TAKES, outputs=GIVES)
def encodings(image: Image, params: object) -> dict[str, Message]:
    """Encodings: the meaning of the bytes of a message."""
    bgr = work_of(image, np.ndarray)
    count = bgr.shape[0] * bgr.shape[1]
    rows = []
    for name in _ENCODED:
        dtype, depth = ENCODINGS[name]
        size = np.dtype(dtype).itemsize
        rows.append(f"    {name:12} {depth} × {8 * size:2} bits {count * depth * size:12} bytes")
    table = "\n".join(rows)
    text = f"""
A sensor_msgs/Image message holds bytes, and the name of their encoding, which defines how to read
them. Read with the wrong name, the same bytes give another picture: above, red and blue are
swapped.

{table}

This picture is bgr8. Depth images are 32FC1, in metres, or 16UC1, in millimetres; mono16 has the
same kind of bytes as 16UC1, but they are gray levels.
"""
    return show(image, cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), text)


LESSON = Lesson(
    "image",
    "how images are stored: pixels, channels, bits and levels, encodings, resolution",
    """
    A camera measures light at many points and writes numbers. Everything else, such as edges, tags
    and maps, is computed from these numbers. This picture has {width} x {height} pixels.
    """,
    [
        Step(pixels),
        Step(channels, "picture"),
        Step(gray_levels, "picture"),
        Step(histogram, "picture"),
        Step(resolution, "picture"),
        Step(encodings, "picture"),
    ],
)
