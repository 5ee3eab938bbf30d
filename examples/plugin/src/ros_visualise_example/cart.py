"""A robot: the Husky with another name."""

from dataclasses import replace

from ros_visualise.simulation.robots.husky import ROBOT as HUSKY
from ros_visualise.simulation.robots.husky.settings import HuskyNodeParams
from ros_visualise.simulation.source import SimulatedRobot, simulated
from ros_visualise.sources.playback import Playback


@simulated("cart", HuskyNodeParams, ("linear.x", "angular.z"))
class Cart(SimulatedRobot):
    """A cart, which drives as a Husky does."""

    def __init__(self, params: HuskyNodeParams, playback: Playback) -> None:
        super().__init__("cart", params, params, playback)


ROBOT = replace(HUSKY, source=Cart)
