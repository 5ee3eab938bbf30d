"""Whether a robot that flies has come to stand on something."""

from __future__ import annotations

from typing import Any

from ros_visualise.simulation.attitude import Vector

_UNDERSIDE_M = 0.05  # a contact farther below the middle carries the robot
_STILL_M_S = 0.15
_PATIENCE_S = 0.4


class TouchDownDetector:
    """Detects that a robot has stood for longer than a moment.

    Args:
        data: the ``mjData`` of the robot.
    """

    def __init__(self, data: Any) -> None:
        self._data = data
        self.reset()

    def reset(self) -> None:
        """It is in the air."""
        self._stood_s = 0.0

    def watch(self, position: Vector, velocity: Vector, dt_s: float) -> bool:
        """Take one step into account; True if it stands."""
        contacts = (self._data.contact[i].pos[2] for i in range(self._data.ncon))
        rests = any(height < position[2] - _UNDERSIDE_M for height in contacts)
        stands = rests and abs(velocity[2]) < _STILL_M_S
        self._stood_s = self._stood_s + dt_s if stands else 0.0
        return self._stood_s > _PATIENCE_S
