"""Monitoring of robots: mission progress, stalls and tipping over."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence

from ros_visualise.simulation.attitude import Quat, Vector

_STEP_M = 0.02
log = logging.getLogger(__name__)
_STALLED_S = 5.0
_LEAST = 0.2  # of the commanded motion
_LIMIT = math.cos(math.radians(60))  # more than any normal motion
_TIPPED_S = 1.0  # a robot may bounce and recover


class MissionMonitor:
    """Monitors a robot's mission, which fails if it makes no progress.

    Args:
        robot: its name.
        patience_s: time without progress after which a mission fails.

    Attributes:
        under_way: True between start and end of a mission.
        finished: True after a mission ended, successfully or not.
        failure: reason of a failure, or empty.
    """

    def __init__(self, robot: str, patience_s: float) -> None:
        self._robot, self._patience_s = robot, patience_s
        self.under_way = self.finished = False
        self.failure = ""
        self.begin_leg()

    def begin(self) -> None:
        """Start monitoring a mission."""
        self.under_way, self.finished, self.failure = True, False, ""
        self.begin_leg()

    def begin_leg(self) -> None:
        """Measure progress along the next leg."""
        self._gone_m, self._still_s = -math.inf, 0.0

    def cancel(self) -> None:
        """Stop monitoring: the robot got other orders."""
        self.under_way = False

    def end(self, failure: str = "") -> None:
        """End the mission, as failed if a reason is given."""
        self.finished = self.finished or self.under_way
        self.failure, self.under_way = failure, False

    def watch(self, gone_m: float, place: Vector, dt_s: float) -> bool:
        """Process one step; True if the mission fails now.

        Args:
            gone_m: distance travelled on this leg; only changes count.
            place: position, metres in ``map``.
        """
        if gone_m > self._gone_m + _STEP_M:
            self._gone_m, self._still_s = gone_m, 0.0
        else:
            self._still_s += dt_s
        if not self.under_way or self._still_s < self._patience_s:
            return False
        where, waited = tell_place(place), f"{self._patience_s:g} s"
        self.end(f"{self._robot} aborted its mission at {where}: no progress for {waited}")
        return True


def tell_place(place: Sequence[float]) -> str:
    """A position in ``map`` in words, rounded to decimetres."""
    x, y = (round(value, 1) + 0.0 for value in place[:2])  # avoids -0.0
    return f"({x:.1f}, {y:.1f})"


class StallDetector:
    """Compares a robot's motion with its command, and warns once when it is stuck.

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
        """Process one step.

        Args:
            wanted: commanded velocity along any axes; zero if there is no command.
            actual: velocity along the same axes.
            place_xy: metres in ``map``.
        """
        square = sum(w * w for w in wanted)
        if square < 1e-6:
            self._begin()
            return
        self._asked += square
        self._made += sum(w * a for w, a in zip(wanted, actual, strict=True))
        self._since_s += dt_s
        if self._since_s > _STALLED_S:
            stuck = self._made < _LEAST * self._asked
            if stuck and not self._warned:
                where = tell_place(place_xy)
                log.warning("%s is stuck at %s: something blocks it", self._robot, where)
            self._warned = stuck
            self._begin()

    def _begin(self) -> None:
        self._asked = self._made = self._since_s = 0.0


class TipOverDetector:
    """Detects that a robot stays tilted for longer than a moment.

    Source: the failure detectors of PX4 and ArduPilot.
    """

    def __init__(self) -> None:
        self._tipped_s = 0.0

    @property
    def detected(self) -> bool:
        """True while the robot lies tipped over."""
        return self._tipped_s > _TIPPED_S

    def watch(self, attitude: Quat, dt_s: float) -> bool:
        """Process one step; True if the robot counts as tipped over from this step on."""
        _, x, y, _ = attitude
        was_detected, upright = self.detected, 1 - 2 * (x * x + y * y) > _LIMIT
        self._tipped_s = 0.0 if upright else self._tipped_s + dt_s
        return self.detected and not was_detected
