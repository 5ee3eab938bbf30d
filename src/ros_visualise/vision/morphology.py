"""Morphology: shapes of bright areas, changed with a structuring element."""

from __future__ import annotations

from enum import Enum

import cv2

from ros_visualise.data import Pixels


class Morphology(Enum):
    """The operation."""

    OFF = "off"
    ERODE = "erode"
    DILATE = "dilate"
    OPEN = "open"
    CLOSE = "close"
    GRADIENT = "gradient"
    TOPHAT = "tophat"
    BLACKHAT = "blackhat"


class KernelShape(Enum):
    """The structuring element."""

    RECT = "rect"
    CROSS = "cross"
    ELLIPSE = "ellipse"


def morph(pixels: Pixels, operation: Morphology, shape: KernelShape, size: int) -> Pixels:
    """Apply the operation to each channel; an even size counts as the next odd one."""
    if operation is Morphology.OFF:
        return pixels
    size |= 1
    element = cv2.getStructuringElement(getattr(cv2, f"MORPH_{shape.name}"), (size, size))
    return cv2.morphologyEx(pixels, getattr(cv2, f"MORPH_{operation.name}"), element)
