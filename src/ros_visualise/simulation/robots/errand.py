"""A mission as it is carried out: whether it gets on, and how it ended."""

from __future__ import annotations

import math

from ros_visualise.simulation.attitude import Vector
from ros_visualise.simulation.robots.progress import tell_place

_STEP_M = 0.02


class Errand:
    """Follows how a robot's mission goes, and gives it up where it goes no further.

    Args:
        robot: its name.
        patience_s: how long a mission may make no progress.

    Attributes:
        finished: a mission was given and is over.
        failure: one line of what ended a mission, or all that it did, too early; or empty.
    """

    def __init__(self, robot: str, patience_s: float) -> None:
        self._robot, self._patience_s = robot, patience_s
        self._under_way = self.finished = False
        self.failure = ""
        self.begin_leg()

    def begin(self) -> None:
        """A mission begins."""
        self._under_way, self.finished, self.failure = True, False, ""
        self.begin_leg()

    def begin_leg(self) -> None:
        """Progress is measured anew from here on."""
        self._gone_m, self._still_s = -math.inf, 0.0

    def drop(self) -> None:
        """Something else was asked for: no mission is under way."""
        self._under_way = False

    def end(self, failure: str = "") -> None:
        """What was under way is over."""
        self.finished = self.finished or self._under_way
        self.failure, self._under_way = failure, False

    def watch(self, gone_m: float, place: Vector, dt_s: float) -> bool:
        """Take in one step; whether the mission was given up in it.

        Args:
            gone_m: how far it has come on this leg, from anywhere.
            place: metres in ``map``.
        """
        if gone_m > self._gone_m + _STEP_M:
            self._gone_m, self._still_s = gone_m, 0.0
        else:
            self._still_s += dt_s
        if not self._under_way or self._still_s < self._patience_s:
            return False
        where, waited = tell_place(place), f"{self._patience_s:g} s"
        self.end(f"{self._robot} gave up its mission at {where}: no progress for {waited}")
        return True
