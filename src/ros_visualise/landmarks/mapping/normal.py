"""Normal equations for a chain of views, tags seen in many views, and shared numbers.

Each view is linked only to the next one and to what all share. So the views are eliminated one
after another (block Cholesky), which leaves a dense system of the tags and the shared numbers, and
their covariance. NumPy is enough for it; a sparse library such as SciPy would be another
dependency.

Source: W. Triggs and others, Bundle Adjustment - A Modern Synthesis, 2000, section 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

Numbers = npt.NDArray[np.int_]
"""Indices of views or tags."""

_TINY = 1e-12


class NormalEquations:
    """J'J and J'r of N views of six numbers each, M tags of six, and G shared numbers.

    Attributes:
        own: (N, 6, 6) of each view.
        next: (N, 6, 6) of each view, as rows, and the next one.
        border: (N, D, 6) of the tags and shared numbers, and of each view.
        rest: (D, D) of the tags and shared numbers; D is 6 M + G.
        slope_own, slope_rest: (N, 6) and (D,) of J'r.
    """

    def __init__(self, views: int, tags: int, shared: int) -> None:
        size = 6 * tags + shared
        self.tags = tags
        self.own, self.next = np.zeros((views, 6, 6)), np.zeros((views, 6, 6))
        self.border, self.rest = np.zeros((views, size, 6)), np.zeros((size, size))
        self.slope_own, self.slope_rest = np.zeros((views, 6)), np.zeros(size)
        part = 6 * tags
        self._tag_border = self.border[:, :part].reshape(views, tags, 6, 6)
        self._tag_rest = self.rest[:part, :part].reshape(tags, 6, tags, 6)
        self._tag_slope = self.slope_rest[:part].reshape(tags, 6)

    def add(
        self,
        residuals: Floats,
        shared: Floats,
        view: tuple[Numbers, Floats] | None = None,
        after: Floats | None = None,
        tags: tuple[tuple[Numbers, Floats], ...] = (),
    ) -> None:
        """Add S terms of K residuals each.

        Args:
            residuals: (S, K).
            shared: (S, K, G) their derivatives by the shared numbers.
            view: indices (S,) of views, and derivatives (S, K, 6) by these.
            after: derivatives (S, K, 6) by the views after those.
            tags: indices (S,) of tags and derivatives (S, K, 6), for each tag of a term.
        """
        G = slice(6 * self.tags, None)
        self.rest[G, G] += np.einsum("ski,skj->ij", shared, shared)
        self.slope_rest[G] += np.einsum("ski,sk->i", shared, residuals)
        for number, (tag, by_tag) in enumerate(tags):
            np.add.at(self._tag_slope, tag, _times(by_tag, residuals[..., None])[..., 0])
            for other, by_other in tags[: number + 1]:
                block = _times(by_tag, by_other)
                _add_at(self._tag_rest, (tag, slice(None), other), block)
                if by_other is not by_tag:
                    _add_at(self._tag_rest, (other, slice(None), tag), np.swapaxes(block, 1, 2))
            self._add_shared(tag, _times(by_tag, shared))
        if view is None:
            return
        for shift, by_view in enumerate((view[1], after)):
            if by_view is not None:
                rows = view[0] + shift
                np.add.at(self.own, rows, _times(by_view, by_view))
                np.add.at(self.slope_own, rows, _times(by_view, residuals[..., None])[..., 0])
                _add_at(self.border, (rows, G), _times(shared, by_view))
                for tag, by_tag in tags:
                    _add_at(self._tag_border, (rows, tag), _times(by_tag, by_view))
        if after is not None:
            np.add.at(self.next, view[0], _times(view[1], after))

    def _add_shared(self, tag: Numbers, block: Floats) -> None:
        """Add (S, 6, G) of tags and the shared numbers."""
        G = slice(6 * self.tags, None)
        rows = (6 * tag[:, None] + np.arange(6)).ravel()
        flat = block.reshape(len(rows), -1)
        np.add.at(self.rest[:, G], rows, flat)
        np.add.at(self.rest[G].T, rows, flat)


@dataclass(frozen=True, eq=False)
class Solution:
    """Result of `solve`.

    Attributes:
        views, rest: (N, 6) and (D,) the step to the minimum.
        covariance: (D, D) of tags and shared numbers.
        traced: (C,) see ``probes``.
    """

    views: Floats
    rest: Floats
    covariance: Floats
    traced: Floats


def solve(
    normal: NormalEquations, damping: float = 0.0, probes: tuple[Floats, Floats] | None = None
) -> Solution:
    """Solve the normal equations.

    Args:
        damping: this many times the diagonal is added (Marquardt, 1963).
        probes: C right-hand sides b, of views (N, 6, C) and of the rest (D, C); ``traced`` is b'
            H^-1 b for each.

    Raises:
        numpy.linalg.LinAlgError: the problem is underdetermined.
    """
    count, size = len(normal.own), len(normal.rest)
    own, rest = normal.own.copy(), normal.rest.copy()
    for matrix in (*own, rest):
        diagonal = np.einsum("ii->i", matrix)
        diagonal += damping * diagonal + _TINY * (1 + diagonal)
    right = -normal.slope_own[..., None], -normal.slope_rest[:, None]
    if probes is not None:
        right = np.dstack([right[0], probes[0]]), np.hstack([right[1], probes[1]])
    wide = np.concatenate([np.swapaxes(normal.border, 1, 2), right[0]], axis=2)
    ties = _eliminate(own, normal.next, wide)
    flat = wide.reshape(6 * count, -1)
    gram = flat.T @ flat
    left = np.linalg.inv(np.linalg.cholesky(rest - gram[:size, :size]))
    covariance = left.T @ left
    of_rest = right[1] - gram[:size, size:]
    tags = covariance @ of_rest
    traced = np.diagonal(gram)[size + 1 :] + np.einsum("ij,ij->j", of_rest, tags)[1:]
    views = _substitute(own, ties, wide[..., size] - wide[..., :size] @ tags[:, 0])
    return Solution(views, tags[:, 0], covariance, traced)


def _eliminate(own: Floats, ties: Floats, wide: Floats) -> Floats:
    """Cholesky's method along the chain, in place: ``own`` becomes the inverses of its factors.

    Each row of ``wide`` becomes the factor's inverse times its remainder.

    Returns:
        (N, 6, 6) likewise for each view and the next one.
    """
    found = np.zeros_like(ties)
    tied = np.asarray(ties.any(axis=(1, 2)))
    alone = ~(tied | np.roll(tied, 1))
    own[alone] = np.linalg.inv(np.linalg.cholesky(own[alone]))
    wide[alone] = own[alone] @ wide[alone]
    for k in np.flatnonzero(~alone):
        own[k] = inverse = np.linalg.inv(np.linalg.cholesky(own[k]))
        wide[k] = inverse @ wide[k]
        if tied[k]:
            found[k] = tie = inverse @ ties[k]
            own[k + 1] -= tie.T @ tie
            wide[k + 1] -= tie.T @ wide[k]
    return found


def _substitute(inverses: Floats, ties: Floats, right: Floats) -> Floats:
    """Back-substitution along the chain."""
    steps = np.zeros_like(right)
    after = np.zeros(6)
    for k in range(len(right) - 1, -1, -1):
        steps[k] = after = inverses[k].T @ (right[k] - ties[k] @ after)
    return steps


def _add_at(array: Floats, where: tuple[Any, ...], values: Floats) -> None:
    np.add.at(array, where, values)


def _times(a: Floats, b: Floats) -> Floats:
    """a' b of each term."""
    product: Floats = np.swapaxes(a, 1, 2) @ b
    return product
