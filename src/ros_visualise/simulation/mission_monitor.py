"""Watching a mission while it is carried out: its progress, and how it ended."""

from __future__ import annotations

import math

from ros_visualise.simulation.attitude import Vector
from ros_visualise.simulation.stall import tell_place

_STEP_M = 0.02


class MissionMonitor:
    """Watches a robot's mission, and ends it as failed where it makes no progress.

    Args:
        robot: its name.
        patience_s: how long a mission may make no progress before it has failed.

    Attributes:
        under_way: a mission was started, and is not over.
        finished: a mission was started and is over, with success or not.
        failure: one line that says why it failed, or empty.
    """

    def __init__(self, robot: str, patience_s: float) -> None:
        self._robot, self._patience_s = robot, patience_s
        self.under_way = self.finished = False
        self.failure = ""
        self.begin_leg()

    def begin(self) -> None:
        """Start to watch a mission."""
        self.under_way, self.finished, self.failure = True, False, ""
        self.begin_leg()

    def begin_leg(self) -> None:
        """Measure progress along the next part of the way."""
        self._gone_m, self._still_s = -math.inf, 0.0

    def cancel(self) -> None:
        """Stop watching: the robot was told to do something else."""
        self.under_way = False

    def end(self, failure: str = "") -> None:
        """The mission is over, by a failure if one is given."""
        self.finished = self.finished or self.under_way
        self.failure, self.under_way = failure, False

    def watch(self, gone_m: float, place: Vector, dt_s: float) -> bool:
        """Take one step into account; True if the mission has failed by it.

        Args:
            gone_m: how far the robot has come on this leg; only changes count.
            place: where it is, metres in ``map``.
        """
        if gone_m > self._gone_m + _STEP_M:
            self._gone_m, self._still_s = gone_m, 0.0
        else:
            self._still_s += dt_s
        if not self.under_way or self._still_s < self._patience_s:
            return False
        where, waited = tell_place(place), f"{self._patience_s:g} s"
        self.end(f"{self._robot} gave up its mission at {where}: no progress for {waited}")
        return True
