"""YOLOX: BGR unscaled, in the upper left corner; boxes in units of their cells.

Source: YOLOX, tools/export_onnx.py and yolox/models/yolo_head.py (read, not copied).
"""

from __future__ import annotations

import numpy as np

from ros_visualise.landmarks.networks.candidates import Candidates
from ros_visualise.landmarks.networks.layouts.boxes import from_centers, grid, likeliest, only
from ros_visualise.landmarks.networks.layouts.layout import OutputLayout, Outputs, Signature
from ros_visualise.landmarks.networks.preparation import Preparation, Resizing, Size

_STRIDES = (8, 16, 32)
_LARGEST_LOG = 10  # no box is 8 exp(10) pixels large; decoded outputs exceed it in some cell


def _is_yolox(found: Signature) -> bool:
    if not found.only_output:
        return False
    rows, columns = found.only_output
    if columns < 6 or rows != found.cells(*_STRIDES):
        return False
    (output,) = found.outputs.values()
    return bool(output[0, :, 2:4].max() < _LARGEST_LOG)


def _decode(outputs: Outputs, size: Size, min_score: float) -> Candidates:
    output = only(outputs)
    cells, steps = grid(size, _STRIDES)
    seen = output[:, 4] >= min_score
    output, cells, steps = output[seen], cells[seen], steps[seen]
    boxes = np.hstack([output[:, :2] + cells, np.exp(output[:, 2:4])]) * steps
    return likeliest(from_centers(boxes), output[:, 4:5] * output[:, 5:])


YOLOX = OutputLayout(
    "YOLOX",
    "[1, cells, 5 + classes], not decoded",
    Preparation(Resizing.CORNER, "BGR", std=(1.0, 1.0, 1.0)),
    _is_yolox,
    _decode,
    True,
)
"""Centre within its cell, logarithm of the size, objectness, and classes."""
