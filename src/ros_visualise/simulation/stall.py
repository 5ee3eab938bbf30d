"""Whether a robot that is told to move does move."""

from __future__ import annotations

import logging
from collections.abc import Sequence

log = logging.getLogger(__name__)

_PATIENCE_S = 5.0
_LEAST = 0.2  # of what is asked for


def tell_place(place: Sequence[float]) -> str:
    """A position in ``map`` in words, to a decimetre."""
    x, y = (round(value, 1) + 0.0 for value in place[:2])  # and nothing is at -0.0
    return f"({x:.1f}, {y:.1f})"


class StallDetector:
    """Compares a robot's motion with what it is told, and warns once where it is stuck.

    Args:
        robot: its name.
    """

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._warned = False
        self._begin()

    def watch(
        self,
        wanted: Sequence[float],
        actual: Sequence[float],
        place_xy: tuple[float, float],
        dt_s: float,
    ) -> None:
        """Take one step into account.

        Args:
            wanted: the velocity that it is told, along any axes; all zero: it is told nothing.
            actual: its velocity along the same axes.
            place_xy: metres in ``map``.
        """
        square = sum(w * w for w in wanted)
        if square < 1e-6:
            self._begin()
            return
        self._asked += square
        self._made += sum(w * a for w, a in zip(wanted, actual, strict=True))
        self._since_s += dt_s
        if self._since_s > _PATIENCE_S:
            stuck = self._made < _LEAST * self._asked
            if stuck and not self._warned:
                where, why = tell_place(place_xy), "something is in its way"
                log.warning("%s does not move at %s: %s", self._robot, where, why)
            self._warned = stuck
            self._begin()

    def _begin(self) -> None:
        self._asked = self._made = self._since_s = 0.0
