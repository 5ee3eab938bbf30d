"""Bayer mosaics: colour pictures from one colour for each pixel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from ros_visualise.data import Image, Message, Pixels
from ros_visualise.lessons.lesson import GIVES, TAKES, Lesson, Step, show, work_of
from ros_visualise.lessons.magnifier import PixelParams, magnified
from ros_visualise.lessons.methods import mosaic as methods
from ros_visualise.lessons.methods.quality import psnr
from ros_visualise.nodes import node
from ros_visualise.plotting.colors import levels
from ros_visualise.plotting.figure import Figure

_REACH = 8
_GREEN = 1  # the channel
_GAIN = 4  # of errors, to make them visible
_EDGE = 30  # levels: a larger difference of two differences shows an edge
_BORDER = 4  # pixels at the border, which lack neighbours


@dataclass(frozen=True, eq=False)
class _Measured:
    """The true picture, the sensor's measurements, and the point to look at."""

    truth: Pixels
    mosaic: Pixels
    place: tuple[int, int]


@node("mosaic", params=PixelParams, inputs=TAKES, outputs=GIVES)
def mosaic(image: Image, params: PixelParams) -> dict[str, Message]:
    """The mosaic: each pixel measures one colour."""
    truth = _of_use(work_of(image, np.ndarray))
    measured = methods.to_mosaic(truth)
    error = cv2.blur(
        _error(methods.demosaic(measured, "bilinear"), truth).astype(np.float32), (9, 9)
    )
    y, x = np.unravel_index(error[4:-4, 4:-4].argmax(), error[4:-4, 4:-4].shape)
    place = params.pixel(truth.shape, (int(x) + 4, int(y) + 4))
    work = _Measured(truth, measured, place)
    text = f"""
        In front of each pixel of the sensor is a colour filter: red, green or blue. In Bayer's
        pattern (1976), here {methods.PATTERN.upper()}, half of the filters are green, the colour
        that the eye sees best:

            R G R G
            G B G B

        So the sensor measures {measured.size} of the {truth.size} numbers of a colour picture. The
        two missing colours of each pixel are estimated from its neighbours: this is called
        demosaicing.
        """
    return show(image, _draw(work, methods.colored(measured), None), text, work)


def _by(method: str, name: str, text: str) -> Any:
    """The node that shows one method."""

    def demosaiced(image: Image, params: object) -> dict[str, Message]:
        work = work_of(image, _Measured)
        found = methods.demosaic(work.mosaic, method)
        error = _error(found, work.truth)
        plain = methods.demosaic(work.mosaic, "bilinear")
        return show(
            image,
            _draw(work, found, error),
            text + _FIGURES,
            greens=_about_green(work, plain, found) if method == "edge-aware" else "",
            more=_compared(psnr(found, work.truth), psnr(plain, work.truth))
            if method != "bilinear"
            else "",
            psnr=psnr(found, work.truth),
            largest=error.max(),
            false=100 * (_chroma_error(found, work.truth) > 20).mean(),
            gain=_GAIN,
        )

    demosaiced.__doc__ = f"Demosaiced: {method}."
    declare: Callable[[Any], Any] = node(name, inputs=TAKES, outputs=GIVES)
    return declare(demosaiced)


_FIGURES = """
        Above are the picture, its error ({gain} times as bright, to make it visible), and a part of
        the picture, enlarged. Compared with the truth: PSNR {psnr:.2f} dB{more}; the largest error
        is {largest} levels; {false:.2f} % of the pixels have a colour that is wrong by more than 20
        levels.
        """

LESSON = Lesson(
    "bayer",
    "how a sensor that measures one colour per pixel gives colour pictures: three "
    "methods, and false colours",
    """
    Nearly every camera measures only one colour at each pixel, and computes the other two. Here
    your picture of {width} x {height} pixels is the truth: we take from it what a sensor would
    measure, and compute the colours again by three methods.
    """,
    [
        Step(mosaic),
        Step(
            _by(
                "bilinear",
                "bilinear",
                """
        A missing colour is the mean of the nearest neighbours that measured it:

            green at a red pixel = (N + E + S + W) / 4

        This is fast, but makes the picture soft. At an edge it mixes the two sides, and does so at
        slightly different places for each colour, so thin lines get false colours.
        """,
            ),
            "mosaic",
        ),
        Step(
            _by(
                "VNG",
                "vng",
                """
        The method "variable number of gradients" (Chang, Cheung, Pang, 1999) measures how much the
        picture changes in eight directions, and averages only along those with little change.
        """,
            ),
            "mosaic",
        ),
        Step(
            _by(
                "edge-aware",
                "edge_aware",
                """
        Green is computed along the edge, not across it: from the left and right neighbours, or from
        those above and below, whichever differ less. Red and blue are means of their neighbours, as
        in the bilinear method. {greens}
        """,
            ),
            "mosaic",
        ),
    ],
)


def _of_use(picture: Pixels) -> Pixels:
    """Cropped to even numbers of rows and columns for the pattern; at least 16 of each."""
    height, width = (max(16, side) for side in picture.shape[:2])
    wide = cv2.copyMakeBorder(
        picture, 0, height - picture.shape[0], 0, width - picture.shape[1], cv2.BORDER_REFLECT
    )
    return np.ascontiguousarray(wide[: height // 2 * 2, : width // 2 * 2])


def _error(found: Pixels, truth: Pixels) -> Pixels:
    """The largest difference of the channels, (height, width)."""
    error: Pixels = cv2.absdiff(found, truth).max(axis=2)
    return error


def _chroma_error(found: Pixels, truth: Pixels) -> Pixels:
    """Errors of the channels relative to each other: zero for a gray error."""
    difference = found.astype(np.int64) - truth
    error: Pixels = difference.max(axis=2) - difference.min(axis=2)
    return error


def _about_green(work: _Measured, plain: Pixels, found: Pixels) -> str:
    """Errors of green where it was not measured, at edges and elsewhere, by two methods."""
    inner = (slice(_BORDER, -_BORDER),) * 2
    level = np.pad(work.mosaic.astype(np.int64), 1, mode="edge")
    across = abs(level[1:-1, 2:] - level[1:-1, :-2])
    down = abs(level[2:, 1:-1] - level[:-2, 1:-1])
    is_edge = (abs(across - down) > _EDGE)[inner]
    is_guessed = (methods.channel_map(*work.mosaic.shape) != _GREEN)[inner]

    def off(picture: Pixels, where: Pixels) -> float:
        error = (picture[..., _GREEN].astype(np.float64) - work.truth[..., _GREEN])[inner]
        return float(np.sqrt(np.mean(error[where & is_guessed] ** 2))) if where.any() else 0.0

    edge, rest = off(found, is_edge), off(found, ~is_edge)
    plain_edge, plain_rest = off(plain, is_edge), off(plain, ~is_edge)
    share = 100 * is_edge[is_guessed].mean()
    why = (
        ": without a clear edge, green is the mean of two neighbours instead of four, which keeps"
        " more noise and texture"
        if rest > plain_rest
        else ""
    )
    return (
        f"At {share:.1f} % of the pixels without a green sample, these two differences are more"
        f" than {_EDGE} levels apart. There the error in green is {edge:.1f} levels (RMS), against"
        f" {plain_edge:.1f} with the bilinear method. At the other pixels it is {rest:.1f}, against"
        f" {plain_rest:.1f}{why}."
    )


def _compared(found_db: float, plain_db: float) -> str:
    return f" ({found_db - plain_db:+.2f} dB compared with the bilinear method)"


def _draw(work: _Measured, picture: Pixels, error: Pixels | None) -> Figure:
    """The picture, its error or the truth, and an enlarged part."""
    seen = work.truth if error is None else levels(error, 255 / _GAIN)
    figure, zoom = magnified([picture, seen], work.place, _REACH)
    zoom.draw(picture)
    return figure
