"""Networks trained by this project's ``training``; they need little decoding.

Objects are in pixels, with their ground points and the variances of these.
"""

from __future__ import annotations

import numpy as np

from ros_visualise.landmarks.networks.candidates import Candidates
from ros_visualise.landmarks.networks.layouts.layout import OutputLayout, Outputs, Signature
from ros_visualise.landmarks.networks.preparation import Preparation, Resizing, Size

IMAGE_NUMBERS = "image_numbers"
"""Output of networks that take several images: the number of the image of each object, or -1."""

ROWS = "rows"
"""Optional input (1,): the objects are padded to a multiple of this number, for GPUs."""

_SIDES = {"boxes": (4,), "scores": (), "classes": (), "points": (2,), "point_variances": (2,)}
"""Output -> its shape after (1, objects)."""


def _is_own(found: Signature) -> bool:
    shapes = {name: output.shape for name, output in found.outputs.items()}
    shapes.pop(IMAGE_NUMBERS, None)
    count = shapes.get("scores", (1,))[-1]
    return shapes == {name: (1, count, *rest) for name, rest in _SIDES.items()}


def _decode(outputs: Outputs, size: Size, min_score: float) -> Candidates:
    good = outputs["scores"][0] >= min_score
    if IMAGE_NUMBERS in outputs:
        good &= outputs[IMAGE_NUMBERS][0] >= 0
    variances = outputs["point_variances"][0, good]
    return Candidates(
        outputs["boxes"][0, good],
        outputs["scores"][0, good],
        outputs["classes"][0, good].astype(np.int64),
        outputs["points"][0, good],
        variances[:, :, None] * np.eye(2, dtype=np.float32),
    )


OWN = OutputLayout(
    "ros_visualise",
    "boxes [1, objects, 4], scores, classes, points [1, objects, 2], point_variances",
    Preparation(Resizing.CENTER),
    _is_own,
    _decode,
    True,
)
"""Boxes, scores, classes, and ground points with their variances, one row per object."""
