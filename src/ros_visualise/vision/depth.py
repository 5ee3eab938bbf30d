"""8 and 16 bits per channel: parameters count from 0 to 255 at both."""

from __future__ import annotations

import cv2
import numpy as np

from ros_visualise.data import Pixels


def unit(pixels: Pixels) -> int:
    """Size of one step of a 0-255 parameter in these pixels: 1, or 257 at 16 bits."""
    return 257 if pixels.dtype == np.uint16 else 1


def full_scale(pixels: Pixels) -> int:
    """The largest value: 255 or 65535."""
    return 255 * unit(pixels)


def to_8_bit(pixels: Pixels) -> Pixels:
    """Scaled from 0-65535 to 0-255 and rounded; 8-bit pixels as they are."""
    if pixels.dtype == np.uint8:
        return pixels
    return cv2.convertScaleAbs(pixels, alpha=1 / 257)


def reusable(pixels: Pixels) -> Pixels | None:
    """The pixels where a result may overwrite them: an array of our own, not a message's."""
    return pixels if pixels.flags.writeable and pixels.flags.c_contiguous else None
