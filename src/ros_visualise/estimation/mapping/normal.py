"""Sparse normal equations of views, tags and shared numbers.

The unknowns are blocks of six numbers: N views in order of time, M tags, and what all views share.
The equations H x = -b have an entry only where two of them appear in one measurement. They are
solved by Cholesky's method in an order that keeps them sparse: the recording is halved again and
again, and each half eliminates what it alone has seen. What is left is a small dense matrix of the
view between the halves, the tags that both have seen, and the shared numbers, which is added to
that of the other half. So where a camera sees a part of the tags at a time, memory grows with the
number of sightings, and not with views times tags. The way back, from the whole to the parts, gives
the solution, and the covariances: those entries of the inverse where H has entries.

Source: A. George, Nested dissection of a regular finite element mesh, 1973, for the order; I. Duff,
J. Reid, The multifrontal solution of indefinite sparse symmetric linear equations, 1983; for the
covariances A. Erisman, W. Tinney, On computing certain elements of the inverse of a sparse matrix,
1975.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

Numbers = npt.NDArray[np.int_]
"""Indices of blocks, views or tags."""

_TINY = 1e-12
_LEAF, _STRIP = 6, 192  # views that are not halved any more; most numbers eliminated at once


@dataclass(eq=False)
class _Front:
    """A dense matrix of some blocks; the first ones are eliminated in it.

    Attributes:
        blocks, own: the blocks, and the number of those that are eliminated.
        children: the fronts whose remainders are added, and where.
        pairs, rows, columns: entries of H that begin here, and where.
    """

    blocks: Numbers
    own: int
    children: list[tuple[int, Numbers]]
    pairs: Numbers
    rows: Numbers
    columns: Numbers


class Structure:
    """Entries of the equations, and the order of elimination.

    Args:
        views, tags: numbers of both.
        shared: number of shared numbers.
        links: (P, 2) blocks that appear in one measurement; the first tag is block ``views``.
            Shared numbers need none.
    """

    def __init__(self, views: int, tags: int, shared: int, links: Numbers) -> None:
        self.views, self.tags, self.shared = views, tags, shared
        self.count = views + tags
        last = np.arange(self.count, self.count + -(-shared // 6))
        self.size = len(last) + self.count
        links = np.reshape(links, (-1, 2)).astype(int)
        links = np.sort(np.concatenate([links, _all(np.arange(self.count), last)]))
        links = np.concatenate([links, _all(last, last)])
        self.keys: Numbers = np.unique(links[links[:, 0] < links[:, 1]] @ [self.size, 1])
        self.fronts: list[_Front] = []
        first, second = np.divmod(self.keys, self.size)
        ends = np.concatenate([first, second]), np.concatenate([second, first])
        order = np.argsort(ends[0], kind="stable")
        self._neighbours = ends[1][order]
        self._begins = np.searchsorted(ends[0][order], np.arange(self.size + 1))
        self._done, self._at = np.zeros(self.size, bool), np.zeros(self.size, int)
        self._pairs = np.concatenate([np.arange(len(self.keys))] * 2)[order]
        self._span = self._spans(first, second)
        self._halve(0, views, np.arange(views, self.size))

    def find(self, a: Numbers, b: Numbers) -> Numbers:
        """Indices of the entries of blocks ``a`` and ``b``, in order."""
        return np.searchsorted(self.keys, a * self.size + b)

    def parts(
        self, parts: Sequence[tuple[Numbers, Floats]], shared: Floats | None
    ) -> list[tuple[Numbers, Floats]]:
        """The derivatives by all blocks, the shared numbers (S, K, G) included."""
        every = [*parts]
        for begin in range(0, self.shared if shared is not None else 0, 6):
            assert shared is not None
            by = np.zeros((*shared.shape[:2], 6))
            some = shared[..., begin : begin + 6]
            by[..., : some.shape[2]] = some
            every.append((np.full(len(shared), self.count + begin // 6), by))
        return every

    def variances(
        self,
        covariance: SparseInverse,
        parts: Sequence[tuple[Numbers, Floats]],
        shared: Floats | None,
    ) -> Floats:
        """(S, K) variances of the values whose derivatives these are; see `NormalEquations.add`."""
        parts = self.parts(parts, shared)
        total = np.zeros(parts[0][1].shape[:2])
        for number, (block, by) in enumerate(parts):
            total += np.einsum("ski,sij,skj->sk", by, covariance.own[block], by)
            for other, by_other in parts[number + 1 :]:
                entry = covariance.pairs[
                    self.find(np.minimum(block, other), np.maximum(block, other))
                ]
                swap = (block > other)[:, None, None]
                entry = np.where(swap, np.swapaxes(entry, 1, 2), entry)
                total += 2 * np.einsum("ski,sij,skj->sk", by, entry, by_other)
        return total

    def shared_covariance(self, covariance: SparseInverse) -> Floats:
        """(G, G) covariance of the shared numbers."""
        last = np.arange(self.count, self.size)
        whole = np.zeros((len(last), 6, len(last), 6))
        for a in last - self.count:
            whole[a, :, a] = covariance.own[self.count + a]
            for b in range(a):
                entry = covariance.pairs[self.find(last[b : b + 1], last[a : a + 1])[0]]
                whole[b, :, a], whole[a, :, b] = entry, entry.T
        return whole.reshape(6 * len(last), -1)[: self.shared, : self.shared]

    def _spans(self, first: Numbers, second: Numbers) -> Numbers:
        """(size, 2) first and last view of each tag, and of those that it is linked with."""
        span = np.tile([self.views, -1], (self.size, 1))
        sees = (first < self.views) & (second >= self.views)
        np.minimum.at(span[:, 0], second[sees], first[sees])
        np.maximum.at(span[:, 1], second[sees], first[sees])
        tied = (first >= self.views) & (second < self.count)
        before = np.zeros(0)
        while tied.any() and not np.array_equal(span, before):
            before = span.copy()
            for a, b in zip(first[tied], second[tied], strict=True):
                span[[a, b]] = min(span[a, 0], span[b, 0]), max(span[a, 1], span[b, 1])
        span[span[:, 1] < 0] = 0, self.views
        span[self.count :] = 0, self.views
        return span

    def _halve(self, low: int, high: int, tags: Numbers) -> int | None:
        """The last front of these views, and of the tags that are seen in them alone."""
        if high - low <= _LEAF:
            return self._eliminate(np.arange(low, high), tags, [])
        middle = (low + high) // 2
        start, end = self._span[tags].T
        left, right = end < middle, (start > middle) & (end < high)
        children = [
            self._halve(low, middle, tags[left]),
            self._halve(middle + 1, high, tags[right]),
        ]
        here = [one for one in children if one is not None]
        return self._eliminate(np.array([middle]), tags[~left & ~right], here)

    def _eliminate(self, views: Numbers, tags: Numbers, children: list[int]) -> int | None:
        own = np.concatenate([views, tags])
        if not len(own):
            return children[0] if children else None
        self._done[own] = True
        slices = [slice(*self._begins[one : one + 2]) for one in own]
        near = np.concatenate([self._neighbours[one] for one in slices])
        borders = [self.fronts[child].blocks[self.fronts[child].own :] for child in children]
        border = np.unique(np.concatenate([near, *borders]))
        border = border[~self._done[border]]
        blocks = np.concatenate([own, border])
        self._at[:] = -1
        self._at[blocks] = np.arange(len(blocks))
        pairs = np.unique(np.concatenate([self._pairs[one] for one in slices]))
        rows, columns = (self._at[one] for one in np.divmod(self.keys[pairs], self.size))
        here = (rows >= 0) & (columns >= 0)
        taken = [(c, _numbers(self._at[b])) for c, b in zip(children, borders, strict=True)]
        front = _Front(blocks, len(own), taken, pairs[here], rows[here], columns[here])
        self.fronts.append(front)
        return len(self.fronts) - 1


class NormalEquations:
    """J'J and J'r, the sums over all measurements.

    Attributes:
        own: (B, 6, 6) of each block.
        pairs: (P, 6, 6) of each pair of blocks with an entry.
        slope: (B, 6) of J'r.
    """

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.own = np.zeros((structure.size, 6, 6))
        self.pairs = np.zeros((len(structure.keys), 6, 6))
        self.slope = np.zeros((structure.size, 6))
        unused = np.arange(structure.shared, 6 * (structure.size - structure.count))
        self.own[structure.count + unused // 6, unused % 6, unused % 6] = 1

    def add(
        self,
        residuals: Floats,
        parts: Sequence[tuple[Numbers, Floats]],
        shared: Floats | None = None,
    ) -> None:
        """Add S terms of K residuals each.

        Args:
            residuals: (S, K).
            parts: blocks (S,), and the derivatives (S, K, 6) by them.
            shared: (S, K, G) the derivatives by the shared numbers.
        """
        parts = self.structure.parts(parts, shared)
        for number, (block, by) in enumerate(parts):
            np.add.at(self.own, block, _times(by, by))
            np.add.at(self.slope, block, _times(by, residuals[..., None])[..., 0])
            for other, by_other in parts[number + 1 :]:
                swap = (block > other)[:, None, None]
                entry = _times(by, by_other)
                entry = np.where(swap, np.swapaxes(entry, 1, 2), entry)
                least, most = np.minimum(block, other), np.maximum(block, other)
                np.add.at(self.pairs, self.structure.find(least, most), entry)


class SparseInverse(NamedTuple):
    """The entries of the inverse where the equations have entries, as in `NormalEquations`."""

    own: Floats
    pairs: Floats


class _Strip(NamedTuple):
    """Numbers that were eliminated together: the inverse of their Cholesky factor, and the rest."""

    at: slice
    inverse: Floats
    tie: Floats


class Factor:
    """The equations, factored.

    Args:
        damping: this many times the diagonal is added (Marquardt, 1963).

    Raises:
        numpy.linalg.LinAlgError: the problem is underdetermined.
    """

    def __init__(self, normal: NormalEquations, damping: float = 0.0) -> None:
        self._normal, self.structure = normal, normal.structure
        own = normal.own.copy()
        diagonal = np.einsum("bii->bi", own)
        diagonal += damping * diagonal + _TINY * (1 + diagonal)
        self._strips: list[list[_Strip]] = []
        left: dict[int, Floats] = {}
        for number, front in enumerate(self.structure.fronts):
            matrix = _assembled(front, own, normal.pairs)
            for child, into in front.children:
                matrix[into[:, None], into] += left.pop(child)
            self._strips.append(_eliminated(matrix, 6 * front.own))
            left[number] = matrix[6 * front.own :, 6 * front.own :].copy()

    def step(self) -> tuple[Floats, Floats, Floats]:
        """The step to the minimum: of views (N, 6), of tags (M, 6), of the shared numbers."""
        found = -self.solve(self._normal.slope[..., None])[..., 0]
        views, count = self.structure.views, self.structure.count
        return found[:views], found[views:count], found[count:].ravel()[: self.structure.shared]

    def solve(self, right: Floats) -> Floats:
        """H^-1 times (B, 6, C)."""
        columns = right.shape[2]
        found = np.array(right)
        for front, strips in zip(self.structure.fronts, self._strips, strict=True):
            here = found[front.blocks].reshape(-1, columns)
            for one in strips:
                here[one.at] = one.inverse @ here[one.at]
                here[one.at.stop :] -= one.tie.T @ here[one.at]
            found[front.blocks] = here.reshape(-1, 6, columns)
        for front, strips in zip(self.structure.fronts[::-1], self._strips[::-1], strict=True):
            here = found[front.blocks].reshape(-1, columns)
            for one in strips[::-1]:
                here[one.at] = one.inverse.T @ (here[one.at] - one.tie @ here[one.at.stop :])
            found[front.blocks[: front.own]] = here[: 6 * front.own].reshape(-1, 6, columns)
        return found

    def inverse(self) -> SparseInverse:
        """The covariances, where the equations have entries."""
        own = np.empty_like(self._normal.own)
        pairs = np.empty_like(self._normal.pairs)
        above: dict[int, Floats] = {}
        for number in range(len(self.structure.fronts) - 1, -1, -1):
            front = self.structure.fronts[number]
            whole = np.empty((6 * len(front.blocks),) * 2)
            whole[6 * front.own :, 6 * front.own :] = above.pop(number, 0.0)
            for at, factor, tie in self._strips[number][::-1]:
                slope, behind = factor.T @ tie, slice(at.stop, None)
                whole[at, behind] = across = -slope @ whole[behind, behind]
                whole[behind, at] = across.T
                whole[at, at] = factor.T @ factor - across @ slope.T
            entries = whole.reshape(len(front.blocks), 6, -1, 6)
            inner = np.arange(front.own)
            own[front.blocks[inner]] = entries[inner, :, inner]
            pairs[front.pairs] = entries[front.rows, :, front.columns]
            for child, into in front.children:
                above[child] = whole[into[:, None], into]
        return SparseInverse(own, pairs)


def _assembled(front: _Front, own: Floats, pairs: Floats) -> Floats:
    """The entries of H that begin in a front, as a dense matrix."""
    count, inner = len(front.blocks), np.arange(front.own)
    blocks = np.zeros((count, 6, count, 6))
    blocks[inner, :, inner] = own[front.blocks[inner]]
    blocks[front.rows, :, front.columns] = pairs[front.pairs]
    blocks[front.columns, :, front.rows] = np.swapaxes(pairs[front.pairs], 1, 2)
    return blocks.reshape(6 * count, 6 * count)


def _eliminated(matrix: Floats, size: int) -> list[_Strip]:
    """Eliminate the first numbers; the remainder is left in the matrix."""
    strips = []
    for begin in range(0, size, _STRIP):
        at = slice(begin, min(begin + _STRIP, size))
        inverse = np.linalg.inv(np.linalg.cholesky(matrix[at, at]))
        tie = inverse @ matrix[at, at.stop :]
        for row in range(at.stop, len(matrix), 4 * _STRIP):
            matrix[row : row + 4 * _STRIP, at.stop :] -= (
                tie[:, row - at.stop :][:, : 4 * _STRIP].T @ tie
            )
        strips.append(_Strip(at, inverse, tie))
    return strips


def _all(a: Numbers, b: Numbers) -> Numbers:
    """All pairs of two lists."""
    return np.stack(np.meshgrid(a, b, indexing="ij"), axis=-1).reshape(-1, 2)


def _numbers(blocks: Numbers) -> Numbers:
    """Indices of the six numbers of each block."""
    return (6 * blocks[:, None] + np.arange(6)).ravel()


def _times(a: Floats, b: Floats) -> Floats:
    """a' b of each term."""
    product: Floats = np.swapaxes(a, 1, 2) @ b
    return product
