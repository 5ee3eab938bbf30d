"""States of many tracks at once: a Kalman filter of each box.

The centre of a box moves at constant velocity, disturbed by white acceleration noise; its size is a
random walk. The four numbers of a box are independent, so that each has a position, a velocity and
the three numbers of their covariance, and all boxes are processed together.

Source: Bar-Shalom, Li and Kirubarajan, Estimation with applications to tracking and navigation,
2001, section 6.2.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

Numbers = npt.NDArray[np.int64]

_TRAIL = 48  # positions
_SEEN = 0.05  # noise of a detected box, of its side
_JITTER = 0.1  # sides/sqrt(s), random walk
_MOVES = np.array([1.0, 1.0, 0.0, 0.0])  # the size has no velocity
_SPEED = 2.0  # sides/s of an object seen once
_EXPECTED = 4.0  # mean squared error of the four numbers of a box, normalized
_MOST = 5.0  # times that noise
_LEAST_S = 1e-3


class Tracks:
    """Arrays with a row for each track.

    Attributes:
        boxes, rates: (N, 4) and their change per second.
        variances, covariances, rate_variances: (N, 4) of these.
        ids: (N,), from 1; 0 until confirmed.
        classes: (N,) numbers.
        evidence: number of detections; weak ones count less.
        seen_ns: time of the last one.
        viewed_ns: time at which it was last expected within the image.
        trails: (N, T, 2) former centres, the newest first; NaN before the first.
    """

    def __init__(self) -> None:
        self.boxes, self.rates = np.zeros((0, 4)), np.zeros((0, 4))
        self.variances, self.covariances, self.rate_variances = np.zeros((3, 0, 4))
        self.ids, self.classes, self.seen_ns, self.viewed_ns = np.zeros((4, 0), np.int64)
        self.evidence = np.zeros(0)
        self.trails = np.zeros((0, _TRAIL, 2))

    def __len__(self) -> int:
        return len(self.ids)

    def begin(self, boxes: Floats, classes: Numbers, evidence: Floats, now_ns: int) -> None:
        """Add tracks of boxes that were detected for the first time."""
        none, side = np.zeros(len(boxes), np.int64), _sides(boxes)
        zero, vague = np.zeros_like(boxes), (_SPEED * side) ** 2 * _MOVES
        trails = np.full((len(boxes), _TRAIL, 2), np.nan)
        trails[:, 0] = boxes[:, :2]
        seen = np.broadcast_to((_SEEN * side) ** 2, boxes.shape)
        now = none + now_ns
        new = boxes, zero, seen, zero, vague, none, classes, now, now, evidence, trails
        for (name, rows), more in zip(vars(self).items(), new, strict=True):
            setattr(self, name, np.concatenate((rows, more)))

    def keep(self, chosen: npt.NDArray[np.bool_]) -> None:
        """Drop all other tracks."""
        if not chosen.all():
            for name, rows in vars(self).items():
                setattr(self, name, rows[chosen])

    def predict(self, elapsed_s: float, acceleration: float) -> None:
        """Go on in time; ``acceleration`` is the change of velocity in a second, in sides/s."""
        s, side = max(elapsed_s, 0.0), _sides(self.boxes)
        q = (acceleration * side) ** 2 * _MOVES
        self.boxes = self.boxes + s * self.rates
        grown = s**3 / 3 * q + (_JITTER * side) ** 2 * max(s, _LEAST_S)
        self.variances = (
            self.variances + 2 * s * self.covariances + s**2 * self.rate_variances + grown
        )
        self.covariances = self.covariances + s * self.rate_variances + s**2 / 2 * q
        self.rate_variances = self.rate_variances + s * q

    def update(
        self, rows: npt.NDArray[np.intp], boxes: Floats, evidence: Floats, now_ns: int
    ) -> None:
        """Fuse detected boxes (M, 4), one for each of these tracks."""
        noise = (_SEEN * _sides(boxes)) ** 2
        variance, covariance = self.variances[rows], self.covariances[rows]
        off = boxes - self.boxes[rows]
        # boxes of merged or cut objects are far from expected: they weigh less
        square = (off**2 / (variance + noise)).sum(axis=1, keepdims=True)
        noise = noise * np.clip(square / _EXPECTED, 1, _MOST)
        gain = variance / (variance + noise)
        gain_of_rate = covariance / (variance + noise)
        self.boxes[rows] = np.maximum(self.boxes[rows] + gain * off, [-np.inf, -np.inf, 1, 1])
        self.rates[rows] += gain_of_rate * off
        self.variances[rows] = (1 - gain) * variance
        self.rate_variances[rows] -= gain_of_rate * covariance
        self.covariances[rows] = (1 - gain) * covariance
        self.evidence[rows] += evidence
        self.seen_ns[rows] = now_ns
        self.trails[rows, 1:] = self.trails[rows, :-1]
        self.trails[rows, 0] = self.boxes[rows, :2]

    def move(self, H: Floats) -> None:
        """Follow the camera: ``H`` (3, 3) takes pixels of the former image to the new one."""
        if not len(self):
            return
        at = np.c_[self.boxes[:, :2], np.ones(len(self))] @ H.T
        seen = at[:, 2] > 1e-9  # what is behind the camera stays where it was
        center = at[seen, :2] / at[seen, 2:]
        J = (H[None, :2, :2] - center[:, :, None] * H[None, 2:, :2]) / at[seen, 2, None, None]
        scale = np.sqrt(np.abs(np.linalg.det(J)))[:, None]
        self.boxes[seen, :2] = center
        self.boxes[seen, 2:] *= scale
        for spread in (self.variances, self.covariances, self.rate_variances):
            spread[seen, :2] = np.einsum("nij,nj->ni", J**2, spread[seen, :2])
            spread[seen, 2:] *= scale**2
        self.rates[seen, :2] = np.einsum("nij,nj->ni", J, self.rates[seen, :2])
        past = self.trails @ H[:, :2].T + H[:, 2]
        self.trails = np.where(past[..., 2:] > 1e-9, past[..., :2] / past[..., 2:], np.nan)


def _sides(boxes: Floats) -> Floats:
    """Mean side of each box: (N, 1)."""
    sides: Floats = np.sqrt(boxes[:, 2:3] * boxes[:, 3:4])
    return sides
