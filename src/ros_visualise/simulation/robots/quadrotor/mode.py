"""What a quadrotor is doing."""

from enum import Enum

from ros_visualise.simulation.mission_monitor import MissionMonitor
from ros_visualise.simulation.route import Carrot, Route


class FlightMode(Enum):
    """What it is doing."""

    LANDED = "landed"
    FLYING = "flying"  # along a way, or hovering at its end
    COMMANDED = "commanded"
    LANDING = "landing"
    HOMING = "homing"  # over a target that it has seen, and down to it


_TOLD = {
    FlightMode.COMMANDED: "is driven",
    FlightMode.LANDING: "landing",
    FlightMode.HOMING: "mission: landing on what it has seen",
}


def tell_flight(
    mode: FlightMode, mission: MissionMonitor, carrot: Carrot | None, route: Route | None
) -> str:
    """What a quadrotor does, in a few words for people.

    Args:
        mode: its mode.
        mission: whether one is under way, and how the last one ended.
        carrot: what it follows, if anything.
        route: the mission's, of which the carrot tells where on it the robot is.
    """
    if mission.failure:
        return f"failed: {mission.failure}"
    if mode is FlightMode.LANDED:
        return "mission over, landed" if mission.finished else "landed"
    if mode in _TOLD:
        return _TOLD[mode]
    if not mission.under_way:
        return "hovers" if carrot is None or carrot.at_end else "flies to its goal"
    is_there = carrot is not None and carrot.route is route
    return f"mission: {carrot.place}" if carrot and is_there else "mission: on the way"
