"""Networks from the exporters of Ultralytics and YOLOv7: RGB, centred with gray padding.

Source: the exporters of Ultralytics, YOLOv5 and YOLOv7 (read, not copied).
"""

from __future__ import annotations

import numpy as np

from ros_visualise.landmarks.networks.candidates import Candidates
from ros_visualise.landmarks.networks.layouts.boxes import (
    class_numbers,
    from_centers,
    likeliest,
    only,
)
from ros_visualise.landmarks.networks.layouts.layout import OutputLayout, Outputs, Signature
from ros_visualise.landmarks.networks.preparation import Preparation, Resizing, Size

_PREPARATION = Preparation(Resizing.CENTER)
_GRIDS = ((8, 16, 32), (8, 16, 32, 64), (4, 8, 16, 32))  # of the plain ones, P6 and P2
_ANCHORS = 3
_MOST_CHOSEN = 1000


def _is_8(found: Signature) -> bool:
    if not (found.only_output and found.detects):
        return False
    rows, columns = found.only_output
    fits_names = not found.class_count or rows == 4 + found.class_count
    return rows > 4 and fits_names and columns in {found.cells(*grid) for grid in _GRIDS}


def _decode_8(outputs: Outputs, size: Size, min_score: float) -> Candidates:
    output = only(outputs)
    output = output[:, output[4:].max(axis=0) >= min_score].T
    return likeliest(from_centers(output[:, :4]), output[:, 4:])


def _is_5(found: Signature) -> bool:
    if not (found.only_output and found.detects):
        return False
    rows, columns = found.only_output
    return columns > 5 and rows in {_ANCHORS * found.cells(*grid) for grid in _GRIDS}


def _decode_5(outputs: Outputs, size: Size, min_score: float) -> Candidates:
    output = only(outputs)
    output = output[output[:, 4] >= min_score]
    return likeliest(from_centers(output), output[:, 4:5] * output[:, 5:])


def _is_10(found: Signature) -> bool:
    if not (found.only_output and found.detects):
        return False
    rows, columns = found.only_output
    return columns == 6 and rows <= _MOST_CHOSEN


def _decode_10(outputs: Outputs, size: Size, min_score: float) -> Candidates:
    output = only(outputs)
    output = output[np.isfinite(output).all(axis=1)]
    return Candidates(output[:, :4], output[:, 4], class_numbers(output[:, 5]))


YOLO_5 = OutputLayout(
    "YOLOv5/YOLOv7", "[1, 3 x cells, 5 + classes]", _PREPARATION, _is_5, _decode_5, True
)
"""Centre, size, objectness, and classes, for three anchors in each cell."""

YOLO_8 = OutputLayout(
    "YOLOv8/11/12", "[1, 4 + classes, cells]", _PREPARATION, _is_8, _decode_8, True
)
"""Centre, size and classes, one column per cell."""

YOLO_10 = OutputLayout("YOLOv10/YOLO26", "[1, N, 6]", _PREPARATION, _is_10, _decode_10, False)
"""Corners, score and class of the best; also the layout of others exported with ``nms=True``."""
