"""NanoDet-Plus: BGR, stretched; each side's distance is a distribution over 8 numbers.

Training maps the centre of the first input pixel to that of the first image pixel, and scales boxes
by the same factor, hence `Resizing.WARP`.

Source: NanoDet, nanodet/model/head/nanodet_plus_head.py, data/transform/warp.py and the
configurations (read, not copied).
"""

from __future__ import annotations

import numpy as np

from ros_visualise.landmarks.networks.candidates import Candidates
from ros_visualise.landmarks.networks.layouts.boxes import grid, likeliest, only
from ros_visualise.landmarks.networks.layouts.layout import OutputLayout, Outputs, Signature
from ros_visualise.landmarks.networks.preparation import Preparation, Resizing, Size

_STRIDES = (8, 16, 32, 64)
_BINS = 8
_SIDES = 4


def _is_nanodet(found: Signature) -> bool:
    if not found.only_output:
        return False
    rows, columns = found.only_output
    return columns > _SIDES * _BINS and rows == found.cells(*_STRIDES)


def _decode(outputs: Outputs, size: Size, min_score: float) -> Candidates:
    output = only(outputs)
    scores = output[:, : -_SIDES * _BINS]
    cells, steps = grid(size, _STRIDES)
    seen = scores.max(axis=1) >= min_score
    output, scores, steps = output[seen], scores[seen], steps[seen]
    bins = output[:, -_SIDES * _BINS :].reshape(-1, _SIDES, _BINS)
    weights = np.exp(bins - bins.max(axis=2, keepdims=True))
    distances = weights @ np.arange(_BINS, dtype=np.float32) / weights.sum(axis=2) * steps
    centers = cells[seen] * steps
    boxes = np.hstack([centers - distances[:, :2], centers + distances[:, 2:]])
    return likeliest(boxes, scores)


NANODET_PLUS = OutputLayout(
    "NanoDet-Plus",
    "[1, cells, classes + 32]",
    Preparation(Resizing.WARP, "BGR", mean=(103.53, 116.28, 123.675), std=(57.375, 57.12, 58.395)),
    _is_nanodet,
    _decode,
    True,
)
"""Classes, and distances to the sides in units of the cell."""
