"""The node that detects what moves before a stationary camera."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Deferred, Detection, Detections, Hypothesis, Image, Pixels
from ros_visualise.landmarks.drawing import draw_detections
from ros_visualise.nodes import node
from ros_visualise.vision import color
from ros_visualise.vision.depth import to_8_bit

_SHADOW = 127  # value that OpenCV gives to shadows
_FIRST = 10  # images until the background is known


@dataclass(frozen=True)
class MotionParams:
    """Parameters of `motion_detector`."""

    threshold: float = param(
        25.0,
        "a pixel counts as moving if its squared distance from the background exceeds this many"
        " variances; smaller is more sensitive",
        min=1,
        max=1000,
        slider=(4, 100),
    )
    history: int = param(
        300, "number of images after which a still object becomes background", min=2, max=100_000
    )
    min_side: int = param(
        12, "minimum width and height of an object, pixels", min=1, max=4096, slider=(1, 100)
    )
    gap: int = param(9, "gap up to which the parts of an object are joined, pixels", min=0, max=200)


@node(
    "motion_detector",
    params=MotionParams,
    inputs={"image": Image},
    outputs={"detections": Detections, "debug_image": Image},
    on_demand=("debug_image",),
)
class MotionDetector:
    """Detects moving objects in images from a stationary camera, without a neural network.

    Source: Zivkovic and van der Heijden, Efficient adaptive density estimation per image pixel for
    the task of background subtraction, 2006.
    """

    def __init__(self, params: MotionParams) -> None:
        self.reset()

    def reset(self) -> None:
        """Learn the background anew: time jumped."""
        self._background = cv2.createBackgroundSubtractorMOG2(detectShadows=True)
        self._seen, self._shape = 0, (0, 0)

    def step(self, image: Image, params: MotionParams) -> dict[str, Any]:
        """The moving objects of an image."""
        color.refuse_measurements(image.encoding)
        pixels = to_8_bit(color.demosaiced(image.pixels, image.encoding))
        order = color.order_of(image.encoding)
        if pixels.shape[:2] != self._shape:
            self.reset()
            self._shape = pixels.shape[:2]
        self._background.setVarThreshold(params.threshold)
        self._background.setHistory(params.history)
        moving = self._background.apply(color.to_bgr(pixels, order)) > _SHADOW
        self._seen += 1
        found = _objects(moving, params) if self._seen > _FIRST else ()
        shown = Deferred((*self._shape, 3), np.uint8, lambda: draw_detections(pixels, order, found))
        return {
            "detections": Detections(found, image.header, image.camera_info),
            "debug_image": replace(image, data=shown, encoding="bgr8"),
        }


def _objects(moving: Pixels, params: MotionParams) -> tuple[Detection, ...]:
    """Boxes of the connected parts; the score is the share of the box that moves, at most 1."""
    mask = cv2.morphologyEx(moving.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    if params.gap:
        mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((params.gap,) * 2, np.uint8))
    _, _, parts, _ = cv2.connectedComponentsWithStats(mask)
    found = []
    for left, top, width, height, area in parts[1:].tolist():
        if min(width, height) >= params.min_side:
            score = min(1.0, 1.5 * area / (width * height))
            center = np.array([left + (width - 1) / 2, top + (height - 1) / 2])
            size = np.array([width, height], np.float64)
            found.append(Detection(center, size, hypotheses=(Hypothesis("moving", score),)))
    return tuple(found)
