"""Functions shared by the decoders."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.landmarks.networks.candidates import Candidates
from ros_visualise.landmarks.networks.layouts.layout import Outputs
from ros_visualise.landmarks.networks.preparation import Size

_LARGEST_CLASS = 1_000_000


def only(outputs: Outputs) -> Floats:
    """The first image's part of the only output."""
    (output,) = outputs.values()
    first: Floats = output[0]
    return first


def from_centers(boxes: Floats) -> Floats:
    """(N, 4) centre and size -> (N, 4) left, top, right, bottom."""
    center, half = boxes[:, :2], boxes[:, 2:4] / 2
    return np.hstack([center - half, center + half])


def likeliest(boxes_xyxy: Floats, scores: Floats) -> Candidates:
    """Candidates of the class with the highest score each, of boxes (N, 4), scores (N, classes)."""
    classes = scores.argmax(axis=1)
    best = scores[np.arange(len(scores)), classes]
    return Candidates(boxes_xyxy, best, classes.astype(np.int64))


def class_numbers(numbers: Floats) -> npt.NDArray[np.int64]:
    """Integers from arbitrary floats."""
    return np.clip(np.nan_to_num(numbers, nan=-1), -1, _LARGEST_CLASS).astype(np.int64)


def grid(size: Size, strides: Sequence[int]) -> tuple[Floats, Floats]:
    """The cells of grids over an image, row by row, grid by grid.

    Returns:
        Column and row of each (N, 2), and its stride (N, 1).
    """
    cells, steps = [], []
    for step in strides:
        rows, columns = np.indices([math.ceil(side / step) for side in size[::-1]], np.float32)
        cells.append(np.stack([columns.ravel(), rows.ravel()], axis=1))
        steps.append(np.full((columns.size, 1), step, np.float32))
    return np.concatenate(cells), np.concatenate(steps)


def sigmoid(logits: Floats) -> Floats:
    """1 / (1 + exp(-x)), without overflow."""
    found: Floats = 0.5 * (1 + np.tanh(0.5 * logits))
    return found
