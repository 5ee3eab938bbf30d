"""The landmarks of a state that rest, with the covariance of all landmarks.

That covariance costs the square of their number at each division. So it is computed a piece at a
time, with every propagation; what is needed earlier is computed at once. Nothing is approximated.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.estimation.robot import core
from ros_visualise.geometry import se3

PER_LANDMARK = 7
"""Errors of a landmark: its twist, and the logarithm of a tag's size."""

TWIST = 6
_PIECE = 36  # rows of the covariance computed at a time

Indices = npt.NDArray[np.intp]


class LandmarkPoses(NamedTuple):
    """Landmarks: their keys, poses (L, 3, 3) and (L, 3), first estimated positions (L, 3), and the
    logarithms (L,) of their sizes by the stated ones.
    """

    keys: list[str]
    R: Floats
    p: Floats
    first_p: Floats
    sizes: Floats

    @classmethod
    def none(cls) -> LandmarkPoses:
        """No landmarks."""
        return cls([], np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))

    def chosen(self, places: Indices) -> LandmarkPoses:
        """Some of them, by their places."""
        arrays = (array[places] for array in self[1:])
        return LandmarkPoses([self.keys[place] for place in places], *arrays)

    def joined(self, others: LandmarkPoses) -> LandmarkPoses:
        """These and others."""
        arrays = (np.concatenate(pair) for pair in zip(self[1:], others[1:], strict=True))
        return LandmarkPoses([*self.keys, *others.keys], *arrays)

    def moved(self, error: Floats) -> LandmarkPoses:
        """The same, corrected by their errors (7 L,)."""
        if not self.keys:
            return self
        errors = error.reshape(-1, PER_LANDMARK)
        R, p = se3.moved(errors[:, :TWIST], self.R, self.p)
        return self._replace(R=R, p=p, sizes=self.sizes + errors[:, TWIST])


def rows_of(places: Indices) -> Indices:
    """Rows of landmarks in a covariance that begins with the robot, by their places."""
    rows: Indices = (core() + PER_LANDMARK * places[:, None] + np.arange(PER_LANDMARK)).ravel()
    return rows


class Whole:
    """Robot and all landmarks at a division; copies of a state share it.

    Args:
        active: the active landmarks.
        joint, gradient: of the state then, see `State`.
        rest: the landmarks that rested then.
    """

    def __init__(
        self, active: LandmarkPoses, joint: Floats, gradient: Floats, rest: Resting | None
    ) -> None:
        self._active, self._joint, self._gradient, self._rest = active, joint, gradient, rest
        self.keys = [*active.keys, *(rest.left if rest else [])]
        self._places = {key: place for place, key in enumerate(self.keys)}
        size = core() + PER_LANDMARK * len(self.keys)
        self._P = np.empty((size, size)) if rest else joint
        self._known = np.full(size, rest is None)
        self._next = 0

    def places(self, keys: Sequence[str]) -> Indices:
        """(K,) places of landmarks among all."""
        return np.array([self._places[key] for key in keys], np.intp)

    @cached_property
    def landmarks(self) -> LandmarkPoses:
        """All landmarks as they were."""
        if self._rest is None:
            return self._active
        before, gained = self._rest.whole, self._across.T @ self._gradient
        left = before.landmarks.chosen(before.places(self._rest.left))
        return self._active.joined(left.moved(gained))

    @property
    def is_settled(self) -> bool:
        """True if the covariance is computed."""
        return self._next >= len(self._P) or bool(self._known.all())

    def settle(self, rows: int = _PIECE) -> None:
        """Compute some further rows of the covariance."""
        if self.is_settled:
            return
        if "_across" not in self.__dict__ and rows == _PIECE:
            self._across  # noqa: B018  which takes as long as a piece
            return
        self._compute(np.arange(self._next, min(self._next + rows, len(self._P))))
        self._next += rows
        if self.is_settled:
            self.landmarks  # noqa: B018  before what it needs is released
            self._rest = None
            self.__dict__.pop("_across", None)

    def covariance(self, rows: Indices, columns: Indices) -> Floats:
        """A part of the covariance; computed alone, if its rows are not yet."""
        if self._known[rows].all():
            return self._P[rows].take(columns, axis=1)
        assert self._rest is not None
        n, before = len(self._joint) - len(self._gradient), self._rest.whole
        change, gained = self._joint[:n, n:], self._joint[n:, n:]
        every = rows_of(before.places(self._rest.left))
        (own, left), (own_columns, left_columns) = (
            (one[one < n], every[one[one >= n] - n]) for one in (rows, columns)
        )
        across, across_columns = (
            before.covariance(one, self._rest.rows) for one in (left, left_columns)
        )
        found = np.empty((len(rows), len(columns)))
        is_own, is_own_column = rows < n, columns < n
        found[np.ix_(is_own, is_own_column)] = self._joint[np.ix_(own, own_columns)]
        found[np.ix_(is_own, ~is_own_column)] = change[own] @ across_columns.T
        found[np.ix_(~is_own, is_own_column)] = across @ change[own_columns].T
        found[np.ix_(~is_own, ~is_own_column)] = (
            before.covariance(left, left_columns) + across @ gained @ across_columns.T
        )
        return found

    @cached_property
    def _across(self) -> Floats:
        """(m, r) covariance, at the division before, of what rested with what it gained on."""
        assert self._rest is not None
        before = self._rest.whole
        return before.covariance(self._rest.rows, rows_of(before.places(self._rest.left)))

    def _compute(self, rows: Indices) -> None:
        rows = rows[~self._known[rows]]
        if not len(rows):
            return
        assert self._rest is not None
        n, across = len(self._joint) - len(self._gradient), self._across
        is_active = rows < n
        own, left = rows[is_active], rows[~is_active] - n
        P, change, gained = self._joint[:n, :n], self._joint[:n, n:], self._joint[n:, n:]
        self._P[own, :n], self._P[own, n:] = P[own], change[own] @ across
        before = self._rest.whole
        every = rows_of(before.places(self._rest.left))
        one = across[:, left].T
        self._P[rows[~is_active], :n] = one @ change.T
        less = before.covariance(every[left], every)
        less += one @ gained @ across
        self._P[rows[~is_active], n:] = less
        self._known[rows] = True


@dataclass(frozen=True, eq=False)
class Resting:
    """The landmarks that rest.

    Attributes:
        whole: all landmarks when the state was divided.
        keys: the landmarks of ``whole`` that have been active since.
        dropped: those that were dropped since.
        rows: (m,) the rows in ``whole`` of all that has been active since.
    """

    whole: Whole
    keys: tuple[str, ...]
    dropped: frozenset[str]
    rows: Indices

    @cached_property
    def left(self) -> list[str]:
        """The landmarks that rest."""
        gone = self.dropped.union(self.keys)
        return [key for key in self.whole.keys if key not in gone]

    def without(self, keys: Iterable[str]) -> Resting:
        """The same after landmarks were dropped."""
        return replace(self, dropped=self.dropped.union(keys))

    def activated(self, keys: Iterable[str], own: Indices) -> Resting:
        """The same with further landmarks active, whose rows in ``whole`` are these."""
        return replace(self, keys=(*self.keys, *keys), rows=np.concatenate([self.rows, own]))
