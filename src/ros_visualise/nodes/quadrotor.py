"""The node of a simulated quadrotor."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.data import FluidPressure, MagneticField, Odometry
from ros_visualise.nodes import action, source
from ros_visualise.simulation.settings import QuadrotorParams, ScenarioParams
from ros_visualise.simulation.source import HELD, INPUTS, OUTPUTS, TARGET, SimulatedRobot
from ros_visualise.sources.playback import Playback


@dataclass(frozen=True)
class QuadrotorNodeParams(ScenarioParams, QuadrotorParams):
    """Its world and mission, and its sensors."""


@source(
    "quadrotor",
    params=QuadrotorNodeParams,
    inputs={**INPUTS, TARGET: Odometry},
    outputs={**OUTPUTS, "mag": MagneticField, "pressure": FluidPressure, "pad": Odometry},
    latched=HELD,
    makes_time=True,
    velocity_axes=("linear.x", "linear.y", "linear.z", "angular.z"),
)
class Quadrotor(SimulatedRobot):
    """A simulated quadrotor with a camera that looks down."""

    def __init__(self, params: QuadrotorNodeParams, playback: Playback) -> None:
        super().__init__("quadrotor", params, params, playback)

    @action("take off and hover")
    def take_off(self) -> None:
        """Take off and hover."""
        self.act("take_off")

    @action("land right below")
    def land(self) -> None:
        """Land right below."""
        self.act("land")
