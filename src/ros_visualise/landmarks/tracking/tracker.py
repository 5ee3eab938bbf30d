"""ByteTrack: detections of high scores continue tracks first, those of low scores what remains.

An object that is nearly covered keeps a detection of a low score, which continues its track and
never begins another one. Source: Zhang et al., ByteTrack: multi-object tracking by associating
every detection box, 2022. Unlike there, time is that of the stamps, boxes are enlarged by the
uncertainty of their prediction, and a low score finds an object again too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.tracking.association import Indices, assign, overlap
from ros_visualise.landmarks.tracking.tracks import Numbers, Tracks

_GATE = 2.0  # standard deviations of a prediction by which boxes are enlarged,
_TOLERANT = 1.5  # of ratios of sides
_REPEATED_NS = 33_000_000
_LARGEST = 0.75  # at most this share of the box


@dataclass(frozen=True)
class TrackingRules:
    """Rules of association.

    Attributes:
        high_score: of detections that may begin a track.
        low_score: of those that continue one.
        min_overlap: least intersection over union of a track with a detection of a high score.
        min_low_overlap: the same for a low score.
        confirmations: detections after which a track is confirmed.
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
        self.begun = self.now_ns = 0

    def step(
        self,
        elapsed_ns: int,
        boxes: Floats,
        scores: Floats,
        classes: Numbers,
        rules: TrackingRules,
        H: Floats | None = None,
    ) -> Numbers:
        """Associate the detections of one image.

        Args:
            elapsed_ns: time since the last image, not negative.
            boxes: (N, 4).
            scores: (N,).
            classes: (N,) numbers.
            rules: of association.
            H: (3, 3) takes pixels of the last image to this one, by the camera's motion.

        Returns:
            (N,) ids of their confirmed tracks; 0 for none.
        """
        self._advance(elapsed_ns, rules, H)
        tracks, is_free = self.tracks, np.ones(len(self.tracks), bool)
        rows = np.full(len(boxes), -1)  # track of each detection
        is_old = tracks.ids > 0
        is_high, is_fit = scores >= rules.high_score, scores >= rules.low_score
        for some, others, least in (
            (is_old, is_high, rules.min_overlap),
            (is_old, is_fit, rules.min_low_overlap),
            (~is_old, is_high, rules.min_overlap),
        ):
            ours, theirs = np.nonzero(some & is_free)[0], np.nonzero(others & (rows < 0))[0]
            if not (len(ours) and len(theirs)):
                continue
            costs = self._costs(ours, boxes[theirs])
            if rules.same_class:
                costs[tracks.classes[ours, None] != classes[theirs]] = 1.0
            found, taken = assign(costs, 1 - least)
            rows[theirs[taken]] = ours[found]
            is_free[ours[found]] = False
        known, begins = rows >= 0, is_high & (rows < 0)
        tracks.update(rows[known], boxes[known], self.now_ns)
        tracks.begin(boxes[begins], classes[begins], self.now_ns)
        rows[begins] = len(is_free) + np.arange(begins.sum())
        self._confirm(rules)
        ids: Numbers = np.append(tracks.ids, 0)[rows]
        tracks.keep((tracks.ids > 0) | (tracks.seen_ns == self.now_ns))
        return ids

    def _advance(self, elapsed_ns: int, rules: TrackingRules, H: Floats | None) -> None:
        """Predict all tracks but those that are lost."""
        self.now_ns += elapsed_ns or _REPEATED_NS
        self.tracks.keep(self.now_ns - self.tracks.seen_ns <= rules.patience_s * 1e9)
        if H is not None:
            self.tracks.move(H)
        self.tracks.predict(elapsed_ns / 1e9, rules.acceleration)

    def _costs(self, rows: Indices, boxes: Floats) -> Floats:
        """One minus the overlap, which counts less where a side differs by more than a third."""
        known = self.tracks.boxes[rows]
        margins = np.minimum(
            _GATE * np.sqrt(self.tracks.variances[rows, :2]), _LARGEST * known[:, 2:]
        )
        ratios = known[:, None, 2:] / boxes[None, :, 2:]
        alike = np.minimum(_TOLERANT * np.minimum(ratios, 1 / ratios).min(axis=2), 1)
        costs: Floats = 1 - alike * overlap(known, boxes, margins)
        return costs

    def _confirm(self, rules: TrackingRules) -> None:
        """Give ids to tracks that were detected often enough."""
        new = np.nonzero((self.tracks.ids == 0) & (self.tracks.hits >= rules.confirmations))[0]
        self.tracks.ids[new] = self.begun + 1 + np.arange(len(new))
        self.begun += len(new)
