"""Candidates decoded from a network's outputs, and the selection among them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

_HIGHEST = 1.001  # allows for rounded scores
_FARTHEST = 1e6  # pixels; also excludes NaN

Kept = npt.NDArray[np.bool_] | npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Candidates:
    """Candidate objects, in pixels of an image or of a network's input.

    ``boxes_xyxy`` (N, 4) are left, top, right and bottom; ``scores`` (N,) go from 0 to 1;
    ``classes`` (N,) are integers. ``points_uv`` (N, 2) are the ground points, with ``covariances``
    (N, 2, 2) in square pixels: None if the network gives none.
    """

    boxes_xyxy: Floats
    scores: Floats
    classes: npt.NDArray[np.int64]
    points_uv: Floats | None = None
    covariances: Floats | None = None

    def __len__(self) -> int:
        return len(self.scores)

    def take(self, which: Kept) -> Candidates:
        """A subset, by index or mask."""
        points, covariances = self.points_uv, self.covariances
        return Candidates(
            self.boxes_xyxy[which],
            self.scores[which],
            self.classes[which],
            None if points is None else points[which],
            None if covariances is None else covariances[which],
        )

    def moved(self, right: float, down: float) -> Candidates:
        """The same, moved by so many pixels."""
        by = np.array([right, down], np.float64)
        points = self.points_uv
        return Candidates(
            self.boxes_xyxy + np.tile(by, 2),
            self.scores,
            self.classes,
            None if points is None else points + by,
            self.covariances,
        )


def join(parts: Sequence[Candidates]) -> Candidates:
    """Candidates of one network in several places."""
    points = [each.points_uv for each in parts if each.points_uv is not None]
    covariances = [each.covariances for each in parts if each.covariances is not None]
    return Candidates(
        np.concatenate([each.boxes_xyxy for each in parts]),
        np.concatenate([each.scores for each in parts]),
        np.concatenate([each.classes for each in parts]),
        np.concatenate(points) if points else None,
        np.concatenate(covariances) if covariances else None,
    )


@dataclass(frozen=True)
class SelectionRules:
    """Rules for accepting candidates.

    Of two boxes of a class that overlap by more than ``max_overlap`` (intersection over union), the
    one with the higher score is kept. ``classes`` are the accepted class numbers; None: all.
    """

    min_score: float = 0.25
    max_overlap: float = 0.45
    most: int = 300
    classes: frozenset[int] | None = None


def choose(candidates: Candidates, choice: SelectionRules, overlapping: bool) -> Candidates:
    """The accepted candidates, the best first; excludes NaN, empty boxes and scores of 0.

    Args:
        candidates: of one image.
        choice: the rules.
        overlapping: True if the network reports an object several times.
    """
    boxes, scores = candidates.boxes_xyxy, candidates.scores
    good = (np.abs(boxes) < _FARTHEST).all(axis=1) & (boxes[:, 2:] > boxes[:, :2]).all(axis=1)
    good &= (scores > 0) & (scores >= choice.min_score) & (scores <= _HIGHEST)  # false for NaN
    if candidates.points_uv is not None:
        good &= (np.abs(candidates.points_uv) < _FARTHEST).all(axis=1)
    if candidates.covariances is not None:
        good &= np.isfinite(candidates.covariances).all(axis=(1, 2))
    if choice.classes is not None:
        good &= np.isin(candidates.classes, list(choice.classes))
    candidates = candidates.take(good)
    candidates = candidates.take(np.argsort(-candidates.scores, kind="stable"))
    if overlapping:
        candidates = candidates.take(_without_overlaps(candidates, choice))
    return candidates.take(np.arange(min(len(candidates), choice.most)))


def _without_overlaps(candidates: Candidates, choice: SelectionRules) -> npt.NDArray[np.intp]:
    """Indices of those not covered by a better one of their class, the best first."""
    boxes = candidates.boxes_xyxy.astype(np.float64)
    # classes are moved apart, so that one search serves all
    apart = candidates.classes[:, None] * (2 * np.abs(boxes).max(initial=0) + 1)
    rectangles = np.hstack([boxes[:, :2] + apart, boxes[:, 2:] - boxes[:, :2]]).tolist()
    scores = candidates.scores.tolist()
    kept = cv2.dnn.NMSBoxes(rectangles, scores, 0.0, choice.max_overlap)
    return np.asarray(kept, np.intp).reshape(-1)
