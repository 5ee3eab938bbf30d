"""Whether a robot has tipped over."""

from __future__ import annotations

import math

from ros_visualise.simulation.attitude import Quat

_LIMIT = math.cos(math.radians(60))  # no robot here drives or flies with so much tilt
_PATIENCE_S = 1.0  # a robot may bounce and recover


class TipOverDetector:
    """Detects that a robot stays tilted beyond a limit for longer than a moment.

    Source: the failure detectors of PX4 and ArduPilot.
    """

    def __init__(self) -> None:
        self._tipped_s = 0.0

    @property
    def detected(self) -> bool:
        """The robot has tipped over and lies there."""
        return self._tipped_s > _PATIENCE_S

    def watch(self, attitude: Quat, dt_s: float) -> bool:
        """Take one step into account; True if the robot counts as tipped over from this step on."""
        _, x, y, _ = attitude
        was_detected, upright = self.detected, 1 - 2 * (x * x + y * y) > _LIMIT
        self._tipped_s = 0.0 if upright else self._tipped_s + dt_s
        return self.detected and not was_detected
