"""A quadrotor with a downward camera."""

from __future__ import annotations

from pathlib import Path

from ros_visualise.core.declarations import action
from ros_visualise.data import Odometry
from ros_visualise.simulation.missions import Mission
from ros_visualise.simulation.model import BuiltWorld
from ros_visualise.simulation.robots import RobotType
from ros_visualise.simulation.robots.quadrotor.control import Quadrotor
from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorNodeParams, QuadrotorParams
from ros_visualise.simulation.source import TARGET, SimulatedRobot, simulated
from ros_visualise.sources.playback import Playback


@simulated(
    "quadrotor",
    QuadrotorNodeParams,
    ("linear.x", "linear.y", "linear.z", "angular.z"),
    {TARGET: Odometry},
)
class QuadrotorSource(SimulatedRobot):
    """A simulated quadrotor with a downward camera."""

    def __init__(self, params: QuadrotorNodeParams, playback: Playback) -> None:
        super().__init__("quadrotor", params, params, playback)

    @action("take off and hover")
    def take_off(self) -> None:
        """Take off and hover."""
        self.act("take_off")

    @action("land here")
    def land(self) -> None:
        """Land here."""
        self.act("land")


def default_mission(world: BuiltWorld) -> Mission:
    """A survey of the centre."""
    return Mission("lawn_mower", size=(15.0, 9.0), spacing=2.4, height=4.5, speed=2.0)


ROBOT = RobotType(
    QuadrotorSource,
    QuadrotorParams,
    Path(__file__).with_name("quadrotor.xml"),
    Quadrotor,
    default_mission,
)
