"""Whether a robot stands upright."""

from __future__ import annotations

import math

from ros_visualise.simulation.attitude import Quat

_LIMIT = math.cos(math.radians(60))  # no robot here goes as tilted as that of its own will
_PATIENCE_S = 1.0  # a bounce may be caught


class Balance:
    """Tells when a robot tips over for good.

    Source: the failure detectors of PX4 and ArduPilot, by a limit on the tilt that lasts.
    """

    def __init__(self) -> None:
        self._tipped_s = 0.0

    @property
    def lost(self) -> bool:
        """It has tipped over, and lies so."""
        return self._tipped_s > _PATIENCE_S

    def watch(self, attitude: Quat, dt_s: float) -> bool:
        """Take in one step; whether it is what tipped it over."""
        _, x, y, _ = attitude
        was_lost, upright = self.lost, 1 - 2 * (x * x + y * y) > _LIMIT
        self._tipped_s = 0.0 if upright else self._tipped_s + dt_s
        return self.lost and not was_lost
