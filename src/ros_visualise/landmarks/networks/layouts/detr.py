"""Transformers that output a set of boxes: RGB, stretched.

Source: RT-DETR (rtdetrv2_pytorch), D-FINE and DEIM, tools/deployment/export_onnx.py and the
postprocessor; RF-DETR, rfdetr/deploy/export.py; Ultralytics' exporter (read, not copied).
"""

from __future__ import annotations

import numpy as np

from ros_visualise.landmarks.networks.candidates import Candidates
from ros_visualise.landmarks.networks.layouts.boxes import (
    class_numbers,
    from_centers,
    likeliest,
    only,
    sigmoid,
)
from ros_visualise.landmarks.networks.layouts.layout import (
    SIZES_INPUT,
    OutputLayout,
    Outputs,
    Signature,
)
from ros_visualise.landmarks.networks.preparation import Preparation, Resizing, Size

_MEAN, _STD = (123.675, 116.28, 103.53), (58.395, 57.12, 57.375)  # of ImageNet
_ULTRALYTICS_QUERIES = 300


def _is_detr(found: Signature) -> bool:
    there = {name: output.shape for name, output in found.outputs.items()}
    if SIZES_INPUT not in found.inputs or not {"labels", "boxes", "scores"} <= there.keys():
        return False
    one = there["scores"]
    return len(one) == 2 and there["labels"] == one and there["boxes"] == (*one, 4)


def _decode_detr(outputs: Outputs, size: Size, min_score: float) -> Candidates:
    classes = class_numbers(outputs["labels"][0])
    return Candidates(outputs["boxes"][0], outputs["scores"][0], classes)


def _is_rf_detr(found: Signature) -> bool:
    boxes, logits = (found.outputs.get(name, np.empty(0)).shape for name in ("dets", "labels"))
    return len(boxes) == len(logits) == 3 and boxes == (1, logits[1], 4) and logits[2] > 0


def _decode_rf_detr(outputs: Outputs, size: Size, min_score: float) -> Candidates:
    boxes = outputs["dets"][0] * np.array(size * 2, np.float32)
    return likeliest(from_centers(boxes), sigmoid(outputs["labels"][0]))


def _is_ultralytics(found: Signature) -> bool:
    if not found.only_output:
        return False
    rows, columns = found.only_output
    named = found.metadata.get("head", "") + found.metadata.get("description", "").lower()
    is_said = "RTDETR" in named or "rtdetr" in named or "rt-detr" in named
    is_plain = columns > 4 and rows == _ULTRALYTICS_QUERIES
    return is_plain and (is_said or (columns != 6 and not named))


def _decode_ultralytics(outputs: Outputs, size: Size, min_score: float) -> Candidates:
    output = only(outputs)
    return likeliest(from_centers(output[:, :4] * np.array(size * 2, np.float32)), output[:, 4:])


DETR = OutputLayout(
    "RT-DETRv2/D-FINE/DEIM",
    f"labels [1, N], boxes [1, N, 4] and scores [1, N], with an input {SIZES_INPUT}",
    Preparation(Resizing.STRETCH, averaged=True),
    _is_detr,
    _decode_detr,
    False,
)
"""Corners for the size given as the second input."""

RF_DETR = OutputLayout(
    "RF-DETR",
    "dets [1, N, 4] and labels [1, N, classes]",
    Preparation(Resizing.STRETCH, mean=_MEAN, std=_STD, averaged=True),
    _is_rf_detr,
    _decode_rf_detr,
    False,
)
"""Centre and size from 0 to 1; logits of the classes; COCO classes are numbered from 1."""

ULTRALYTICS_RT_DETR = OutputLayout(
    "Ultralytics RT-DETR",
    "[1, 300, 4 + classes]",
    Preparation(Resizing.STRETCH),
    _is_ultralytics,
    _decode_ultralytics,
    False,
)
"""Centre and size from 0 to 1, and classes."""
