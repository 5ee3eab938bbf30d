"""ByteTrack: detections of high scores continue tracks first, those of low scores what remains.

An object that is nearly covered keeps a detection of a low score, which continues its track and
begins no other one. Source: Zhang et al., ByteTrack: multi-object tracking by associating every
detection box, 2022. Unlike there, time is that of the stamps, boxes are enlarged by the
uncertainty of their prediction, and a low score finds an object again too.

A pair too far apart for the uncertainty is refused, as by Wojke, Bewley and Paulus, Simple online
and realtime tracking with a deep association metric, 2017; unless the object was detected in the
last image and nobody else takes the detection, for it may have turned. An object that leaves the
image goes on beyond its border, so that nobody who enters there takes its id.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.landmarks.tracking.borders import clipped, completed, in_view
from ros_visualise.landmarks.tracking.tracks import Numbers, Tracks

_GATE = 2.0  # standard deviations of a prediction by which boxes are enlarged,
_TOLERANT = 1.5  # of ratios of sides
_FARTHEST = 5.0  # standard deviations between a prediction and a detection,
_NOISE = 0.05  # whose centre has this noise, of its sides
_LEFT_NS = 1_000_000_000  # beyond the border; who comes back later is somebody else
_WEAK = 0.4  # a detection between the scores counts this much for a new track
_REPEATED_NS = 33_000_000
_LARGEST = 0.75  # at most this share of the box


STILL = np.eye(3)
"""Motion of a camera that does not move."""
Indices = npt.NDArray[np.intp]


@dataclass(frozen=True)
class TrackingRules:
    """Rules of association.

    Attributes:
        high_score: of detections that begin a track.
        low_score: of those that continue one. Those above the middle of both begin one too, and
            count less.
        min_overlap: least intersection over union of a track with a detection of a high score.
        min_low_overlap: the same for a low score.
        confirmations: detections of a high score after which a track is confirmed.
        patience_s: how long a track stays without detections.
        acceleration: change of an object's velocity in a second, in sides of its box.
        same_class: detections continue tracks of their own class alone.
    """

    high_score: float = 0.5
    low_score: float = 0.1
    min_overlap: float = 0.2
    min_low_overlap: float = 0.5
    confirmations: int = 2
    patience_s: float = 3.0
    acceleration: float = 0.25
    same_class: bool = False

    @property
    def weak_score(self) -> float:
        """Score above which detections begin a track, though they count less."""
        return (self.low_score + self.high_score) / 2


class ByteTracker:
    """Tracks of all objects; see the module.

    Attributes:
        tracks: the present ones, some of them not detected in the last image.
        begun: number of tracks that were confirmed.
        now_ns: time since the first image; an image that repeats a stamp takes 33 ms.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Start over, with new ids."""
        self.tracks = Tracks()
        self.begun = self.now_ns = self._former_ns = 0

    def step(
        self,
        elapsed_ns: int,
        boxes: Floats,
        scores: Floats,
        classes: Numbers,
        rules: TrackingRules,
        H: Floats | None = None,
        size: tuple[int, int] | None = None,
    ) -> Numbers:
        """Associate the detections of one image.

        Args:
            elapsed_ns: time since the last image, not negative.
            boxes: (N, 4).
            scores: (N,).
            classes: (N,) numbers.
            rules: of association.
            H: (3, 3) takes pixels of the last image to this one, by the camera's motion; None if
                that is unknown: then no pair is too far apart.
            size: width and height of the image; None if they are unknown.

        Returns:
            (N,) ids of their confirmed tracks; 0 for none.
        """
        self._advance(elapsed_ns, rules, H, size)
        rows = self._associate(boxes, scores, classes, rules, size)
        tracks, known = self.tracks, rows >= 0
        is_new = (scores > rules.weak_score) & ~known
        evidence = np.where(scores >= rules.high_score, 1.0, _WEAK)
        continued = rows[known]
        whole = boxes[known]
        if size is not None:
            whole = completed(whole, tracks.boxes[continued], size)
        tracks.update(continued, whole, evidence[known], self.now_ns)
        rows[is_new] = len(tracks) + np.arange(is_new.sum())
        tracks.begin(boxes[is_new], classes[is_new], evidence[is_new], self.now_ns)
        self._confirm(rules)
        ids: Numbers = np.append(tracks.ids, 0)[rows]
        tracks.keep((tracks.ids > 0) | (tracks.seen_ns == self.now_ns))
        return ids

    def _associate(
        self,
        boxes: Floats,
        scores: Floats,
        classes: Numbers,
        rules: TrackingRules,
        size: tuple[int, int] | None,
    ) -> Indices:
        """The row of the track of each detection; -1 for none."""
        tracks, is_free = self.tracks, np.ones(len(self.tracks), bool)
        rows = np.full(len(boxes), -1)
        costs, is_far = self._costs(boxes, size)
        if rules.same_class:
            costs[tracks.classes[:, None] != classes] = 1.0
        near = np.where(is_far, 1.0, costs) if self._is_sure else costs
        is_old, turns = tracks.ids > 0, tracks.seen_ns == self._former_ns
        is_high, is_fit = scores >= rules.high_score, scores >= rules.low_score
        for some, others, least, table in (
            (is_old, is_high, rules.min_overlap, near),
            (is_old, is_fit, rules.min_low_overlap, near),
            (~is_old, scores > rules.weak_score, rules.min_overlap, near),
            (turns, is_high, rules.min_overlap, costs),
        ):
            ours, theirs = np.nonzero(some & is_free)[0], np.nonzero(others & (rows < 0))[0]
            if not (len(ours) and len(theirs)):
                continue
            found, taken = assign(table[ours[:, None], theirs], 1 - least)
            rows[theirs[taken]] = ours[found]
            is_free[ours[found]] = False
        return rows

    def _advance(
        self,
        elapsed_ns: int,
        rules: TrackingRules,
        H: Floats | None,
        size: tuple[int, int] | None,
    ) -> None:
        """Predict all tracks but those that are lost."""
        self._former_ns = self.now_ns
        self.now_ns += elapsed_ns or _REPEATED_NS
        self.tracks.keep(self.now_ns - self.tracks.seen_ns <= rules.patience_s * 1e9)
        self._is_sure = H is not None
        if H is not None and H is not STILL:
            self.tracks.move(H)
        self.tracks.predict(elapsed_ns / 1e9, rules.acceleration)
        if size is not None:
            self.tracks.viewed_ns[in_view(self.tracks.boxes, size)] = self.now_ns
            self.tracks.keep(self.now_ns - self.tracks.viewed_ns <= _LEFT_NS)

    def _costs(
        self, boxes: Floats, size: tuple[int, int] | None
    ) -> tuple[Floats, npt.NDArray[np.bool_]]:
        """One minus the overlap of each track and box, and which are too far apart: (N, M).

        Overlap counts less where a side differs by more than a third.
        """
        known, variances = self.tracks.boxes, self.tracks.variances
        if size is not None:
            known = clipped(known, size)
        margins = np.minimum(_GATE * np.sqrt(variances[:, :2]), _LARGEST * known[:, 2:])
        spread = variances[:, :2] + (_NOISE * known[:, 2:]) ** 2
        alike, square = np.ones((len(known), len(boxes))), np.zeros((len(known), len(boxes)))
        for axis in (0, 1):
            ratios = known[:, None, 2 + axis] / boxes[None, :, 2 + axis]
            alike = np.minimum(alike, _TOLERANT * np.minimum(ratios, 1 / ratios))
            off = known[:, None, axis] - boxes[None, :, axis]
            square = square + off**2 / spread[:, None, axis]
        return 1 - alike * overlap(known, boxes, margins), square > _FARTHEST**2

    def _confirm(self, rules: TrackingRules) -> None:
        """Give ids to tracks that were detected often enough."""
        new = np.nonzero((self.tracks.ids == 0) & (self.tracks.evidence >= rules.confirmations))[0]
        self.tracks.ids[new] = self.begun + 1 + np.arange(len(new))
        self.begun += len(new)


def overlap(first: Floats, second: Floats, margins_uv: Floats) -> Floats:
    """Intersection over union of boxes (N, 4) and (M, 4): (N, M).

    Both boxes of a pair are enlarged on each side by ``margins_uv`` (N, 2), so that small and fast
    objects overlap too.

    Source: Yang et al., Hard to track objects with irregular motions, 2023 (buffered IoU).
    """
    shared, whole_a, whole_b = np.ones((3, len(first), len(second)))
    for axis in (0, 1):  # reductions over an axis of two cost more than the rest
        grown = 2 * margins_uv[:, None, axis]
        a = first[:, None, 2 + axis] + grown
        b = second[None, :, 2 + axis] + grown
        apart = np.abs(first[:, None, axis] - second[None, :, axis])
        shared *= np.maximum(np.minimum((a + b) / 2 - apart, np.minimum(a, b)), 0)
        whole_a *= a
        whole_b *= b
    return shared / (whole_a + whole_b - shared)


def assign(costs: Floats, limit: float) -> tuple[Indices, Indices]:
    """The rows and columns of the pairs with the least total cost.

    A row or column without a pair costs half of the limit: no pair costs more than the limit.
    """
    allowed = costs < limit
    rows, columns = np.nonzero(allowed)
    alone = (allowed.sum(1)[rows] == 1) & (allowed.sum(0)[columns] == 1)
    if alone.all():
        return rows, columns
    some_rows, some_columns = np.unique(rows[~alone]), np.unique(columns[~alone])
    found = _least(np.minimum(costs[np.ix_(some_rows, some_columns)], limit), limit)
    chosen = some_rows[found[0]], some_columns[found[1]]
    good = allowed[chosen]
    return np.r_[rows[alone], chosen[0][good]], np.r_[columns[alone], chosen[1][good]]


def _least(costs: Floats, limit: float) -> tuple[Indices, Indices]:
    """The assignment as a problem of transport: equal weights give whole flows."""
    side = max(costs.shape)
    square = np.full((side, side), limit, np.float32)
    square[: costs.shape[0], : costs.shape[1]] = costs
    weights = np.ones((side, 1), np.float32)
    flow = cv2.EMD(weights, weights, cv2.DIST_USER, square)[2]
    rows, columns = np.nonzero(flow[: costs.shape[0], : costs.shape[1]] > 0.5)
    return rows, columns
