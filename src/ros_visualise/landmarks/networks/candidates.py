"""What a network may have found, and the choice among it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

_HIGHEST = 1.001  # a score that was rounded
_FARTHEST = 1e6  # pixels; what is no number is not less either

Kept = npt.NDArray[np.bool_] | npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Candidates:
    """Things in an image or in what a network is given, in its pixels.

    ``boxes_xyxy`` (N, 4) are left, top, right and bottom; ``scores`` (N,) go from 0 to 1;
    ``classes`` (N,) are whole numbers. ``points_uv`` (N, 2) are the points that they stand on, with
    ``covariances`` (N, 2, 2) in square pixels: None where a network does not tell them.
    """

    boxes_xyxy: Floats
    scores: Floats
    classes: npt.NDArray[np.int64]
    points_uv: Floats | None = None
    covariances: Floats | None = None

    def __len__(self) -> int:
        return len(self.scores)

    def take(self, which: Kept) -> Candidates:
        """Those alone, by number or by a mask."""
        points, covariances = self.points_uv, self.covariances
        return Candidates(
            self.boxes_xyxy[which],
            self.scores[which],
            self.classes[which],
            None if points is None else points[which],
            None if covariances is None else covariances[which],
        )


@dataclass(frozen=True)
class SelectionRules:
    """What of the candidates counts as found.

    Of two of a class whose boxes overlap by more than ``max_overlap`` (intersection over union) the
    one with the higher score counts. ``classes`` are the numbers of those that are wanted; None:
    all.
    """

    min_score: float = 0.25
    max_overlap: float = 0.45
    most: int = 300
    classes: frozenset[int] | None = None


def choose(candidates: Candidates, choice: SelectionRules, overlapping: bool) -> Candidates:
    """The best ones, the best first; what has no number, no area or a score of 0 is none.

    Args:
        candidates: of one image.
        choice: what counts.
        overlapping: the network tells the same thing several times.
    """
    boxes, scores = candidates.boxes_xyxy, candidates.scores
    good = (np.abs(boxes) < _FARTHEST).all(axis=1) & (boxes[:, 2:] > boxes[:, :2]).all(axis=1)
    good &= (scores > 0) & (scores >= choice.min_score) & (scores <= _HIGHEST)  # which nan is not
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
    """The numbers of those that no better one of their class covers; the best come first."""
    boxes = candidates.boxes_xyxy.astype(np.float64)
    # each class lies in a place of its own, so that one search does for all
    apart = candidates.classes[:, None] * (2 * np.abs(boxes).max(initial=0) + 1)
    rectangles = np.hstack([boxes[:, :2] + apart, boxes[:, 2:] - boxes[:, :2]]).tolist()
    scores = candidates.scores.tolist()
    kept = cv2.dnn.NMSBoxes(rectangles, scores, 0.0, choice.max_overlap)
    return np.asarray(kept, np.intp).reshape(-1)
