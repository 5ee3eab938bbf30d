"""Numbers over time, and their extremes in each pixel column at any zoom.

The extremes of each block of 64 samples are kept, so that a view reads few of the samples: those
blocks that lie in a column as a whole, and the samples at its sides.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

Indices = npt.NDArray[np.int64]
_Group = tuple[Indices, Indices]
"""Indices of samples, and the numbers of the columns that own them."""
_Wanted = Callable[[Indices, Indices], npt.NDArray[np.bool_]]
_Array = TypeVar("_Array", Floats, Indices)
_BLOCK = 64
_FEW = 1024
_MAX_BYTES = 512 << 20
_NONE = -1


class StoreFull(Exception):
    """A store has reached its limit of memory."""


class SampleStore:
    """Some numbers of a topic's messages in order of time, as float64; thread-safe.

    A sample takes 8 bytes for its time and 8.4 for each number. A store that grows as messages
    arrive forgets its older half at 512 MiB; one that is read from a recording ends there.

    Args:
        paths: the names of the numbers.
        share: see below.

    Attributes:
        share: share that is loaded, 0 to 1; None: it grows as messages arrive.
        error: why it ends early; empty if it does not.
        version: another number after each change.
    """

    def __init__(
        self, paths: Sequence[str], share: float | None = None, max_bytes: int = _MAX_BYTES
    ) -> None:
        self.paths = tuple(paths)
        self.share, self.error = share, ""
        self.version = 0
        self._most = max(max_bytes // (8 + 9 * len(self.paths)), 2 * _BLOCK)
        self._count = 0
        self._times_s = np.empty(_FEW)
        self._columns = [_Column() for _ in self.paths]
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return self._count

    @property
    def nbytes(self) -> int:
        """Size in memory, bytes."""
        return self._times_s.nbytes + sum(column.nbytes for column in self._columns)

    def add(self, times_s: Floats, values: Floats) -> None:
        """Add samples; late ones are put in their places.

        Args:
            times_s: (N,), in any order.
            values: (N, number of paths); NaN for missing ones.

        Raises:
            StoreFull: the limit of memory is reached, by a store that is read from a recording.
        """
        order = np.argsort(times_s, kind="stable")
        times_s, values = times_s[order], values[order]
        with self._lock:
            if not len(times_s):
                return
            if self._count + len(times_s) > self._most:
                if self.share is not None:
                    raise StoreFull
                self._forget_oldest(len(times_s))
                times_s, values = times_s[-self._most // 2 :], values[-self._most // 2 :]
            first = int(np.searchsorted(self._times_s[: self._count], times_s[0], "right"))
            if first < self._count:
                times_s, values = self._merge(first, times_s, values)
            self._put(first, times_s, values)

    def cut(self, time_s: float) -> None:
        """Remove all from a time on."""
        with self._lock:
            self._count = int(np.searchsorted(self._times_s[: self._count], time_s))
            self._level(self._count)

    def break_line(self) -> None:
        """Draw no line from the last sample to the next."""
        with self._lock:
            last_s = self._times_s[max(self._count - 1, 0) : self._count].copy()
        self.add(last_s, np.full((len(last_s), len(self.paths)), np.nan))

    def whole(self, path: str) -> tuple[Floats, Floats]:
        """All times and values."""
        with self._lock:
            values = self._columns[self.paths.index(path)].values[: self._count]
            return self._times_s[: self._count].copy(), values.copy()

    @property
    def span_s(self) -> tuple[float, float] | None:
        """Times of the first and the last sample; None without any."""
        with self._lock:
            if not self._count:
                return None
            return float(self._times_s[0]), float(self._times_s[self._count - 1])

    def at(self, path: str, time_s: float) -> float:
        """The last value until a time; NaN before the first."""
        with self._lock:
            index = int(np.searchsorted(self._times_s[: self._count], time_s, "right")) - 1
            return (
                float(self._columns[self.paths.index(path)].values[index])
                if index >= 0
                else math.nan
            )

    def between(
        self, path: str, start_s: float, end_s: float, columns: int
    ) -> tuple[Floats, Floats]:
        """Samples from one time to another, with one more on either side.

        Args:
            path: one of ``paths``.
            start_s, end_s: seconds.
            columns: number of pixel columns, from the first of these samples to the last; of each
                with more than two samples, the lowest, the highest, and one NaN if there is any.
        """
        column = self._columns[self.paths.index(path)]
        with self._lock:
            times_s = self._times_s[: self._count]
            first = int(np.searchsorted(times_s, start_s))
            last = int(np.searchsorted(times_s, end_s, "right"))
            if last - first <= 2 * columns:
                chosen = np.arange(first, last)
            else:
                ends_s = max(start_s, times_s[first]), min(end_s, times_s[last - 1])
                edges_s = np.linspace(*ends_s, columns + 1)[1:-1]
                edges = first + np.searchsorted(times_s[first:last], edges_s)
                chosen = column.extremes(np.concatenate([[first], edges, [last]]))
            around = [max(first - 1, 0), min(last, max(self._count - 1, 0))]
            chosen = np.unique(np.concatenate([chosen, around]))[: self._count]
            return times_s[chosen], column.values[chosen]

    def _put(self, first: int, times_s: Floats, values: Floats) -> None:
        """Write samples from an index on, in place of all that is there."""
        end = first + len(times_s)
        room = min(end + end // 2, max(end, self._most))
        if end > len(self._times_s):
            self._times_s = _grown(self._times_s, room)
        self._times_s[first:end] = times_s
        for number, column in enumerate(self._columns):
            if end > len(column.values):
                column.values = _grown(column.values, room)
            column.values[first:end] = values[:, number]
        self._count = end
        self._level(first)

    def _merge(self, first: int, times_s: Floats, values: Floats) -> tuple[Floats, Floats]:
        """The samples from an index on together with others, in order of time."""
        there = np.stack([column.values[first : self._count] for column in self._columns], axis=1)
        times_s = np.concatenate([self._times_s[first : self._count], times_s])
        order = np.argsort(times_s, kind="stable")
        return times_s[order], np.concatenate([there, values])[order]

    def _forget_oldest(self, room: int) -> None:
        gone = min(max(self._count // 2, self._count + room - self._most), self._count)
        kept = slice(gone, self._count)
        self._count -= gone
        self._times_s[: self._count] = self._times_s[kept].copy()
        for column in self._columns:
            column.values[: self._count] = column.values[kept].copy()
        self._level(0)

    def _level(self, first: int) -> None:
        for column in self._columns:
            column.level(first, self._count)
        self.version += 1


class _Column:
    """Values, and for each full block of them the indices of its extremes.

    Attributes:
        values: room for more than there are.
    """

    def __init__(self) -> None:
        self.values = np.empty(_FEW)
        self._blocks = 0
        self._marks = np.empty((_FEW // _BLOCK, 3), np.int64)

    @property
    def nbytes(self) -> int:
        return self.values.nbytes + self._marks.nbytes

    def level(self, first: int, count: int) -> None:
        """Mark the blocks that have changed from an index on, of so many values in all."""
        self._blocks = min(self._blocks, first // _BLOCK)
        full = count // _BLOCK
        if full > len(self._marks):
            self._marks = _grown(self._marks, full + full // 2)
        if full > self._blocks:
            fresh = self.values[self._blocks * _BLOCK : full * _BLOCK].reshape(-1, _BLOCK)
            starts = np.arange(self._blocks, full) * _BLOCK
            self._marks[self._blocks : full] = _marks_of(fresh, starts)
            self._blocks = full

    def extremes(self, edges: Indices) -> Indices:
        """Indices of the extremes, and of one NaN, of each range from one edge to the next.

        Args:
            edges: (N + 1,), ascending.
        """
        starts, stops = edges[:-1], edges[1:]
        first = np.minimum(-(-starts // _BLOCK), self._blocks)
        last = np.maximum(np.minimum(stops // _BLOCK, self._blocks), first)
        left = np.where(first < last, first * _BLOCK, stops)
        right = np.where(first < last, last * _BLOCK, stops)
        sides = [_ranges(starts, left), _ranges(right, stops)]
        blocks, owners = _ranges(first, last)
        marks, count = self._marks[blocks], len(starts)
        lows = _best(self.values, count, [*sides, (marks[:, 0], owners)], np.fmin)
        highs = _best(self.values, count, [*sides, (marks[:, 1], owners)], np.fmax)
        has_nan = marks[:, 2] != _NONE
        nans = _firsts(count, [*sides, (marks[has_nan, 2], owners[has_nan])], self._is_nan)
        return np.concatenate([lows, highs, nans])

    def _is_nan(self, found: Indices, _: Indices) -> npt.NDArray[np.bool_]:
        return np.isnan(self.values[found])


def _marks_of(values: Floats, starts: Indices) -> Indices:
    """Indices of the lowest value, the highest and the first NaN of each row; -1 without NaN."""
    is_nan = np.isnan(values)
    lows = np.where(is_nan, np.inf, values).argmin(axis=1)
    highs = np.where(is_nan, -np.inf, values).argmax(axis=1)
    marks = np.stack([lows, highs, is_nan.argmax(axis=1)], axis=1) + starts[:, None]
    marks[~is_nan.any(axis=1), 2] = _NONE
    return marks


def _best(values: Floats, count: int, groups: list[_Group], better: np.ufunc) -> Indices:
    """For each owner that has numbers, the index of the first one of its best."""
    best = np.full(count, np.nan)
    for found, owners in groups:
        if len(found):
            starts = np.flatnonzero(np.r_[True, owners[1:] != owners[:-1]])
            own = owners[starts]
            best[own] = better(best[own], better.reduceat(values[found], starts))
    return _firsts(count, groups, lambda found, owners: values[found] == best[owners])


def _firsts(count: int, groups: list[_Group], is_wanted: _Wanted) -> Indices:
    """For each owner that has any, the first index that is wanted."""
    chosen: Indices = np.full(count, _NONE)
    for found, owners in groups:
        wanted = is_wanted(found, owners)
        chosen[owners[wanted][::-1]] = found[wanted][::-1]  # of several, the last is written
    kept: Indices = chosen[chosen != _NONE]
    return kept


def _ranges(starts: Indices, stops: Indices) -> tuple[Indices, Indices]:
    """All indices of the ranges, and the number of the range of each."""
    counts = stops - starts
    owners = np.repeat(np.arange(len(starts)), counts)
    shift = np.repeat(starts - (np.cumsum(counts) - counts), counts)
    found: Indices = np.arange(len(owners)) + shift
    return found, owners


def _grown(array: _Array, count: int) -> _Array:
    """A copy with room for so many."""
    grown: _Array = np.empty((count, *array.shape[1:]), array.dtype)
    grown[: len(array)] = array
    return grown
