"""The node of a simulated rover."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ros_visualise.data import (
    Image,
    Imu,
    NavSatFix,
    Odometry,
    PointCloud,
    PoseStamped,
    Text,
    Transforms,
    Twist,
)
from ros_visualise.nodes import action, source
from ros_visualise.params import param
from ros_visualise.simulation.settings import HuskyParams
from ros_visualise.simulation.source import SimulatedRobot
from ros_visualise.sources.playback import Playback

_OUTPUTS = {
    "image": Image,
    "imu": Imu,
    "fix": NavSatFix,
    "odom": Odometry,
    "truth": Odometry,
    "points": PointCloud,
    "tf": Transforms,
    "tf_static": Transforms,
    "robot_description": Text,
}


@dataclass(frozen=True)
class HuskyNodeParams(HuskyParams):
    """Where it is, what it is to do, and its sensors."""

    world: str = param("field", "plane, playpen or field", restart=True)
    mission: str = param(
        "none", "square, figure_of_eight, lawn_mower, default, a YAML file, or none", restart=True
    )
    seed: int = param(0, "of all random errors", min=0, max=2**31 - 1, restart=True)


@source(
    "husky",
    params=HuskyNodeParams,
    inputs={"cmd_vel": Twist, "goal": PoseStamped},
    outputs=_OUTPUTS,
    latched=("tf_static", "robot_description"),
    makes_time=True,
)
class Husky:
    """A simulated rover, a skid-steered Husky."""

    def __init__(self, params: HuskyNodeParams, playback: Playback) -> None:
        self._robot = SimulatedRobot(
            "husky", params.world, params.mission, params.seed, params, playback
        )

    def spare(self, wants: Callable[[str], bool]) -> None:
        """Render and scan only while somebody listens."""
        self._robot.wants = wants

    def messages(self) -> Iterator[tuple[str, Any]]:
        """What its sensors measure, each when its time has come."""
        return self._robot.messages()

    def receive(self, port: str, message: Any) -> None:
        """Take a velocity or a goal."""
        self._robot.command(message) if port == "cmd_vel" else self._robot.goto(message)

    @action("stop, and give up what it was doing")
    def stop(self) -> None:
        """Stop, and give up what it was doing."""
        self._robot.act("stop")

    @action("begin its mission anew")
    def start_mission(self) -> None:
        """Begin its mission anew."""
        self._robot.act("start_mission")

    def close(self) -> None:
        """Nothing is open: the renderer goes with the messages."""
