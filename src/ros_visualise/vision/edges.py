"""Edges: Canny, gradients and the Laplacian, and how they look over their image."""

from __future__ import annotations

from enum import Enum

import cv2
import numpy as np

from ros_visualise.data import Pixels
from ros_visualise.vision.color import to_bgr
from ros_visualise.vision.depth import to_8_bit, unit


class Method(Enum):
    """Method of edge detection."""

    CANNY = "canny"
    SOBEL = "sobel"
    SCHARR = "scharr"
    LAPLACIAN = "laplacian"


class Aperture(Enum):
    """Size of the derivative's kernel."""

    THREE = 3
    FIVE = 5
    SEVEN = 7


class EdgeColor(Enum):
    """The colour of edges."""

    RED = "red"
    GREEN = "green"
    BLUE = "blue"
    YELLOW = "yellow"
    MAGENTA = "magenta"
    CYAN = "cyan"
    WHITE = "white"
    BLACK = "black"


_FULL_CHANNELS = {
    EdgeColor.RED: "R",
    EdgeColor.GREEN: "G",
    EdgeColor.BLUE: "B",
    EdgeColor.YELLOW: "GR",
    EdgeColor.MAGENTA: "BR",
    EdgeColor.CYAN: "BG",
    EdgeColor.WHITE: "BGR",
    EdgeColor.BLACK: "",
}

# how much more than the 3x3 kernel a larger one makes of the same step
_SOBEL_GAIN = {3: 1, 5: 12, 7: 160}
_LAPLACIAN_GAIN = {3: 1, 5: 4, 7: 48}
_SCHARR_GAIN = 4


def smooth(gray: Pixels, sigma: float) -> Pixels:
    """Blur by a Gaussian of that standard deviation in pixels; 0 is off."""
    return cv2.GaussianBlur(gray, (0, 0), sigma) if sigma else gray


def gradient_magnitude(gray: Pixels, aperture: int) -> Pixels:
    """Euclidean norm of the Sobel gradient, float32, unscaled: the gradient that Canny sees."""
    border = cv2.BORDER_REPLICATE
    dx = cv2.Sobel(gray, cv2.CV_32F, 1, 0, ksize=aperture, borderType=border)
    dy = cv2.Sobel(gray, cv2.CV_32F, 0, 1, ksize=aperture, borderType=border)
    return cv2.magnitude(dx, dy)


def automatic_thresholds(strength: Pixels) -> tuple[float, float]:
    """Thresholds (low, high) that separate the edges of an image from the rest.

    The low one is Otsu's threshold of the strengths, in 256 levels; the high one twice that.

    Source: Otsu, A threshold selection method from gray-level histograms, 1979; a high threshold
    of two or three times the low one: Canny, A computational approach to edge detection, 1986.
    """
    largest = float(strength.max())
    if largest == 0:
        return 0.0, 0.0
    levels = cv2.convertScaleAbs(strength, alpha=255 / largest)
    otsu, _ = cv2.threshold(levels, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    low = otsu * largest / 255
    return low, 2 * low


def canny(
    gray: Pixels,
    low: float,
    high: float,
    aperture: int = 3,
    *,
    l2_gradient: bool = False,
    automatic: bool = False,
    min_gradient: float = 0,
) -> Pixels:
    """Edges of one pixel's width: 255 on an edge, else 0.

    Args:
        gray: 8 or 16 bits; 16 are scaled to 8.
        low, high: hysteresis thresholds, in whichever order.
        aperture: of the Sobel gradient, 3, 5 or 7.
        l2_gradient: compare the Euclidean norm of the gradient instead of |dx| + |dy|.
        automatic: take `automatic_thresholds` instead of low and high, and the Euclidean norm.
        min_gradient: an edge stays only where the `gradient_magnitude` exceeds this; 0 is off.

    Source: Canny, 1986, as OpenCV has it.
    """
    gray = to_8_bit(gray)
    strength = gradient_magnitude(gray, aperture) if automatic or min_gradient else None
    if automatic and strength is not None:
        low, high = automatic_thresholds(strength)
    norm_is_l2 = l2_gradient or automatic
    edges = cv2.Canny(gray, low, high, apertureSize=aperture, L2gradient=norm_is_l2)
    return edges if strength is None else suppress(edges, strength, min_gradient)


def derivative(gray: Pixels, method: Method, aperture: int, sigma: float) -> Pixels:
    """Strength of the edges by a derivative, float32, on the scale of the 3x3 Sobel gradient.

    Unblurred, a black and white step has strength 1020 with every method and aperture. Blurring
    flattens edges; a sigma above 1 is made up for by that factor, its square for the Laplacian.

    Args:
        gray: 8 or 16 bits.
        method: the magnitude of the Sobel or Scharr gradient, or of the Laplacian.
        aperture: 3, 5 or 7; Scharr is always 3x3.
        sigma: of the Gaussian blur before it; with it the Laplacian is that of a Gaussian.

    Source: Lindeberg, Feature detection with automatic scale selection, 1998, for the factors.
    """
    exact = smooth(gray.astype(np.float32) / unit(gray), sigma)
    flattened = max(sigma, 1.0)
    if method is Method.SOBEL:
        return gradient_magnitude(exact, aperture) * (flattened / _SOBEL_GAIN[aperture])
    if method is Method.SCHARR:
        return gradient_magnitude(exact, cv2.FILTER_SCHARR) * (flattened / _SCHARR_GAIN)
    curvature = cv2.Laplacian(exact, cv2.CV_32F, ksize=aperture, borderType=cv2.BORDER_REPLICATE)
    return np.abs(curvature) * (flattened**2 / _LAPLACIAN_GAIN[aperture])


def to_levels(
    strength: Pixels,
    low: float,
    high: float,
    *,
    automatic: bool = False,
    min_gradient: float = 0,
) -> Pixels:
    """An 8-bit image of strengths: 0 up to low, 255 from high on, in between proportional.

    Args:
        strength: float32.
        low, high: in whichever order; where they are equal, the image is binary.
        automatic: take `automatic_thresholds` instead.
        min_gradient: what does not exceed this is black; 0 is off.
    """
    low, high = automatic_thresholds(strength) if automatic else sorted((low, high))
    if low == high:
        levels = np.where(strength > low, np.uint8(255), np.uint8(0))
    else:
        slope = 255 / (high - low)
        levels = cv2.addWeighted(strength, slope, strength, 0, -low * slope, dtype=cv2.CV_8U)
    return suppress(levels, strength, min_gradient)


def suppress(edges: Pixels, strength: Pixels, minimum: float) -> Pixels:
    """Keep an edge only where its strength exceeds the minimum; 0 is off."""
    if minimum == 0:
        return edges
    return np.where(strength > minimum, edges, np.uint8(0))


def draw_over(pixels: Pixels, order: str, edges: Pixels, color: EdgeColor) -> Pixels:
    """The image as bgr8 with its edges in a colour, faint ones blended in.

    Args:
        pixels: gray or colour, 8 or 16 bits.
        order: of the channels, ``BGR`` or ``RGB``.
        edges: uint8, of the same height and width.
        color: of the edges.
    """
    full = _FULL_CHANNELS[color]
    channels = zip("BGR", cv2.split(to_bgr(to_8_bit(pixels), order)), strict=True)
    drawn = [(cv2.add if name in full else cv2.subtract)(one, edges) for name, one in channels]
    return cv2.merge(drawn)
