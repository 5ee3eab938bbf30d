"""The node of a simulated quadrotor."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.data import FluidPressure, MagneticField
from ros_visualise.nodes import action, source
from ros_visualise.simulation.settings import PlaceParams, QuadrotorParams
from ros_visualise.simulation.source import INPUTS, LATCHED, OUTPUTS, SimulatedRobot
from ros_visualise.sources.playback import Playback


@dataclass(frozen=True)
class QuadrotorNodeParams(PlaceParams, QuadrotorParams):
    """Where it is, what it is to do, and its sensors."""


@source(
    "quadrotor",
    params=QuadrotorNodeParams,
    inputs=INPUTS,
    outputs={**OUTPUTS, "mag": MagneticField, "pressure": FluidPressure},
    latched=LATCHED,
    makes_time=True,
)
class Quadrotor(SimulatedRobot):
    """A simulated quadrotor that looks down."""

    def __init__(self, params: QuadrotorNodeParams, playback: Playback) -> None:
        super().__init__("quadrotor", params, params, playback)

    @action("rise and stay in the air")
    def take_off(self) -> None:
        """Rise and stay in the air."""
        self.act("take_off")

    @action("come down where it is")
    def land(self) -> None:
        """Come down where it is."""
        self.act("land")

    @action("stop, and give up what it was doing")
    def stop(self) -> None:
        """Stop, and give up what it was doing."""
        self.act("stop")

    @action("set it down at its start; all begins anew but time")
    def reset(self) -> None:
        """Set it down at its start, where all begins anew but time."""
        super().reset()

    @action("begin its mission anew")
    def start_mission(self) -> None:
        """Begin its mission anew."""
        self.act("start_mission")
