"""The robot at each odometry message since a state: late images start at the last one before."""

from __future__ import annotations

from bisect import bisect_right

from ros_visualise.landmarks.navigation.motion import OdometryStep
from ros_visualise.landmarks.navigation.propagation import Propagation
from ros_visualise.landmarks.navigation.sensor_buffer import SensorBuffer
from ros_visualise.landmarks.navigation.state import FilterState


class PropagationTrail:
    """The propagations from a state by later measurements, each computed once."""

    def __init__(self, past: SensorBuffer, state: FilterState, stamp_ns: int = 0) -> None:
        self._sensors = past
        self.restart(state, stamp_ns)

    def restart(self, state: FilterState, stamp_ns: int) -> None:
        """Start at another or updated state."""
        self._stamps_ns, self._several = [stamp_ns], [Propagation(state)]

    @property
    def newest(self) -> Propagation:
        """The robot now."""
        return self._several[-1]

    def add(self, step: OdometryStep, is_located: bool) -> None:
        """Propagate by a new step."""
        new = self.newest.copy()
        self._sensors.newest(new, step, is_located)
        self._append(step, new)

    def catch_up(self, stamp_ns: int, is_located: bool) -> None:
        """Propagate to a time by all known odometry."""
        for step in self._sensors.steps(self._stamps_ns[-1], stamp_ns):
            new = self.newest.copy()
            self._sensors.propagate(new, step, is_located)
            self._append(step, new)

    def at(self, stamp_ns: int, is_located: bool) -> Propagation:
        """The robot at a time after the state."""
        place = bisect_right(self._stamps_ns, stamp_ns) - 1
        found = self._several[place].copy()
        for step in self._sensors.steps(self._stamps_ns[place], stamp_ns):
            self._sensors.propagate(found, step, is_located)
        return found

    def _append(self, step: OdometryStep, new: Propagation) -> None:
        self._stamps_ns.append(step.to_ns)
        self._several.append(new)
