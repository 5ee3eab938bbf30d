"""The node of a simulated rover."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.nodes import source
from ros_visualise.simulation.settings import HuskyParams, ScenarioParams
from ros_visualise.simulation.source import HELD, INPUTS, OUTPUTS, SimulatedRobot
from ros_visualise.sources.playback import Playback


@dataclass(frozen=True)
class HuskyNodeParams(ScenarioParams, HuskyParams):
    """Its world and mission, and its sensors."""


@source(
    "husky",
    params=HuskyNodeParams,
    inputs=INPUTS,
    outputs=OUTPUTS,
    latched=HELD,
    makes_time=True,
    velocity_axes=("linear.x", "angular.z"),
)
class Husky(SimulatedRobot):
    """A simulated rover, a skid-steered Husky."""

    def __init__(self, params: HuskyNodeParams, playback: Playback) -> None:
        super().__init__("husky", params, params, playback)
