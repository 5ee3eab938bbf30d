"""The robot at each odometry since a state: whoever comes late begins at the last one before."""

from __future__ import annotations

from bisect import bisect_right

from ros_visualise.landmarks.navigation.motion import OdometryStep
from ros_visualise.landmarks.navigation.propagation import Propagation
from ros_visualise.landmarks.navigation.sensor_buffer import SensorBuffer
from ros_visualise.landmarks.navigation.state import FilterState


class PropagationTrail:
    """What follows from a state by what was measured since, and nothing of which is done twice."""

    def __init__(self, past: SensorBuffer, state: FilterState, stamp_ns: int = 0) -> None:
        self._past = past
        self.restart(state, stamp_ns)

    def restart(self, state: FilterState, stamp_ns: int) -> None:
        """Begin at another state, or at what was made of it."""
        self._stamps_ns, self._several = [stamp_ns], [Propagation(state)]

    @property
    def newest(self) -> Propagation:
        """The robot now."""
        return self._several[-1]

    def add(self, step: OdometryStep, is_located: bool) -> None:
        """Go on by an odometry that has just come."""
        new = self.newest.copy()
        self._past.newest(new, step, is_located)
        self._append(step, new)

    def catch_up(self, stamp_ns: int, is_located: bool) -> None:
        """Go on until a time, by all odometries that are known."""
        for step in self._past.steps(self._stamps_ns[-1], stamp_ns):
            new = self.newest.copy()
            self._past.go(new, step, is_located)
            self._append(step, new)

    def at(self, stamp_ns: int, is_located: bool) -> Propagation:
        """The robot at a time after the state."""
        place = bisect_right(self._stamps_ns, stamp_ns) - 1
        found = self._several[place].copy()
        for step in self._past.steps(self._stamps_ns[place], stamp_ns):
            self._past.go(found, step, is_located)
        return found

    def _append(self, step: OdometryStep, new: Propagation) -> None:
        self._stamps_ns.append(step.to_ns)
        self._several.append(new)
