"""Metrics of detections: average precision, recall at a precision, ground points.

Source: Everingham et al., The PASCAL Visual Object Classes Challenge, 2015.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
_OVERLAP = 0.5


class Found(NamedTuple):
    """Detections of one class in one picture, the best first: boxes (n, 4), scores (n,)."""

    boxes: Array
    scores: Array


class Matches(NamedTuple):
    """Scores of all detections that count, whether each is right, and how many there were."""

    scores: Array
    right: npt.NDArray[np.bool_]
    truths: int


def match(found: Found, truth: Array, ignored: npt.NDArray[np.bool_]) -> list[int]:
    """The number of the true box that each detection is; -1: none; -2: one that does not count.

    Args:
        truth: (m, 4) boxes x0 y0 x1 y1; those that are ``ignored`` (m,) neither help nor hurt.
    """
    taken: set[int] = set()
    result = []
    for box in found.boxes:
        overlaps = iou(box, truth)
        open_ = [n for n in np.argsort(-overlaps) if overlaps[n] >= _OVERLAP and n not in taken]
        counted = [int(n) for n in open_ if not ignored[n]]
        if counted:
            taken.add(counted[0])
            result.append(counted[0])
        else:
            result.append(-2 if open_ or _mostly_in(box, truth[ignored]) else -1)
    return result


def gather(pictures: Sequence[tuple[Found, Array, npt.NDArray[np.bool_]]]) -> Matches:
    """Match picture by picture; the arguments are those of `match`."""
    scores, right, truths = [], [], 0
    for found, truth, ignored in pictures:
        truths += int(np.sum(~ignored))
        for score, number in zip(found.scores, match(found, truth, ignored), strict=True):
            if number != -2:
                scores.append(float(score))
                right.append(number >= 0)
    order = np.argsort(-np.array(scores), kind="stable")
    return Matches(np.array(scores)[order], np.array(right, bool)[order], truths)


def average_precision(matches: Matches) -> float:
    """The area under precision over recall, precision made falling; nan without any truth."""
    if not matches.truths:
        return float("nan")
    precision, recall = curve(matches)
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    return float(np.sum(np.diff(np.concatenate([[0.0], recall])) * envelope))


def recall_at(matches: Matches, precision: float) -> tuple[float, float]:
    """The highest recall with at least that precision, and the least score that gives it."""
    precisions, recalls = curve(matches)
    fine = np.nonzero(precisions >= precision)[0]
    if not len(fine):
        return 0.0, 1.0
    return float(recalls[fine[-1]]), float(matches.scores[fine[-1]])


def curve(matches: Matches) -> tuple[Array, Array]:
    """Precision and recall when the best 1, 2, ... detections count."""
    right = np.cumsum(matches.right)
    return right / np.arange(1, len(right) + 1), right / max(matches.truths, 1)


def iou(box: Array, others: Array) -> Array:
    """Intersection over union of a box (4,) with others (m, 4)."""
    low, high = np.maximum(box[:2], others[:, :2]), np.minimum(box[2:], others[:, 2:])
    both = np.prod(np.clip(high - low, 0, None), axis=1)
    areas = np.prod(others[:, 2:] - others[:, :2], axis=1)
    return np.asarray(both / np.maximum(np.prod(box[2:] - box[:2]) + areas - both, 1e-9))


def _mostly_in(box: Array, others: Array) -> bool:
    low, high = np.maximum(box[:2], others[:, :2]), np.minimum(box[2:], others[:, 2:])
    both = np.prod(np.clip(high - low, 0, None), axis=1)
    return bool(np.any(both > 0.5 * np.prod(box[2:] - box[:2])))
