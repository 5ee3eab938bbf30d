"""Edges of an image, and the edges drawn over it."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ros_visualise.core.errors import UnsupportedImage
from ros_visualise.core.params import param, unless
from ros_visualise.data import Deferred, Image, Pixels
from ros_visualise.nodes import node
from ros_visualise.vision import color
from ros_visualise.vision.edges import (
    Aperture,
    EdgeColor,
    Method,
    canny,
    derivative,
    draw_over,
    smooth,
    to_levels,
)
from ros_visualise.vision.threads import fit_threads

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class EdgeParams:
    """Parameters of `edge_detector`."""

    method: Method = param(
        Method.CANNY,
        "edge detector: canny gives thin lines, the others edge strength from black at low to"
        " white at high",
        group="method",
    )
    low: int = param(
        100,
        "lower threshold of the hysteresis, on the scale of 8-bit images; swapped with high if"
        " larger",
        min=0,
        max=800,
        used=unless("auto", True),
    )
    high: int = param(
        200, "upper threshold of the hysteresis", min=0, max=800, used=unless("auto", True)
    )
    auto: bool = param(
        False,
        "automatic low and high: low by Otsu's method on the gradient, high twice that",
        group="method",
    )
    aperture: Aperture = param(
        Aperture.THREE,
        "kernel size, pixels; a larger one gives larger gradients, which need larger thresholds",
        group="method",
        used=unless("method", Method.SCHARR),
    )
    l2_gradient: bool = param(
        False,
        "canny: use the Euclidean norm of the gradient, which is more exact than |dx| + |dy|",
        group="method",
        used=lambda p: p.method is Method.CANNY and not p.auto,
    )
    sigma: float = param(
        0.0,
        "standard deviation of the Gaussian blur before edge detection, pixels; 0 is off; blur and"
        " laplacian together are a LoG",
        min=0,
        max=20,
        slider=(0, 5),
        group="method",
    )
    min_gradient: int = param(
        0,
        "minimum Euclidean norm of the gradient on an edge; 0 is off",
        min=0,
        max=800,
        group="method",
    )
    overlay_color: EdgeColor = param(
        EdgeColor.RED, "colour of the edges in the overlay", group="method"
    )


@node(
    "edge_detector",
    params=EdgeParams,
    inputs={"image": Image},
    outputs={"edges": Image, "edges_overlay": Image},
    on_demand=("edges_overlay",),
)
def edge_detector(image: Image, params: EdgeParams) -> dict[str, Image]:
    """Detects edges (mono8) and, on demand, draws them over the image."""
    color.refuse_measurements(image.encoding)
    if color.is_bayer(image.encoding):
        raise UnsupportedImage(
            f"cannot detect edges in a raw Bayer image ({image.encoding});"
            " set filters.demosaic=true"
        )
    order = color.order_of(image.encoding)
    fit_threads(image.pixels)
    edges = _detect(color.to_gray(image.pixels, order), params)
    overlay = Deferred(
        (*edges.shape, 3),
        np.uint8,
        lambda: draw_over(image.pixels, order, edges, params.overlay_color),
    )
    return {
        "edges": replace(image, data=edges, encoding="mono8"),
        "edges_overlay": replace(image, data=overlay, encoding="bgr8"),
    }


@cache
def _remark_swapped(low: int, high: int) -> None:
    text = "edge_detector: low=%d is above high=%d; using low=%d and high=%d instead"
    log.warning(text, low, high, high, low)


def _detect(gray: Pixels, p: EdgeParams) -> Pixels:
    aperture = p.aperture.value
    if p.low > p.high and not p.auto:
        _remark_swapped(p.low, p.high)
    if p.method is Method.CANNY:
        return canny(
            smooth(gray, p.sigma),
            p.low,
            p.high,
            aperture,
            l2_gradient=p.l2_gradient,
            automatic=p.auto,
            min_gradient=p.min_gradient,
        )
    strength = derivative(gray, p.method, aperture, p.sigma)
    return to_levels(strength, p.low, p.high, automatic=p.auto, min_gradient=p.min_gradient)
