"""Modes of a quadrotor, and the detection of its landing."""

from __future__ import annotations

from enum import Enum
from typing import Any

from ros_visualise.simulation.attitude import Vector
from ros_visualise.simulation.monitoring import MissionMonitor
from ros_visualise.simulation.route import Carrot, Route

_UNDERSIDE_M = 0.05  # a contact farther below the centre carries the robot
_STILL_M_S = 0.15
_PATIENCE_S = 0.4


class FlightMode(Enum):
    """Mode of a quadrotor."""

    LANDED = "landed"
    FLYING = "flying"  # along a route, or hovering at its end
    COMMANDED = "commanded"
    LANDING = "landing"
    HOMING = "homing"  # above a visible target, and down to it


_TOLD = {
    FlightMode.COMMANDED: "manual control",
    FlightMode.LANDING: "landing",
    FlightMode.HOMING: "mission: landing on the target",
}


def tell_flight(
    mode: FlightMode, mission: MissionMonitor, carrot: Carrot | None, route: Route | None
) -> str:
    """Activity of a quadrotor, in a few words.

    Args:
        mode: its mode.
        mission: the monitor of its mission.
        carrot: followed at present, if any.
        route: of the mission; the carrot may be on another.
    """
    if mission.failure:
        return f"failed: {mission.failure}"
    if mode is FlightMode.LANDED:
        return "mission over, landed" if mission.finished else "landed"
    if mode in _TOLD:
        return _TOLD[mode]
    if not mission.under_way:
        return "hovering" if carrot is None or carrot.at_end else "flying to goal"
    is_there = carrot is not None and carrot.route is route
    return f"mission: {carrot.place}" if carrot and is_there else "mission: flying to the route"


class TouchDownDetector:
    """Detects that a robot has stood for longer than a moment.

    Args:
        data: the ``mjData`` of the robot.
    """

    def __init__(self, data: Any) -> None:
        self._data = data
        self.reset()

    def reset(self) -> None:
        """Reset in the air."""
        self._stood_s = 0.0

    def watch(self, position: Vector, velocity: Vector, dt_s: float) -> bool:
        """Process one step; True if it stands."""
        contacts = (self._data.contact[i].pos[2] for i in range(self._data.ncon))
        rests = any(height < position[2] - _UNDERSIDE_M for height in contacts)
        stands = rests and abs(velocity[2]) < _STILL_M_S
        self._stood_s = self._stood_s + dt_s if stands else 0.0
        return self._stood_s > _PATIENCE_S
