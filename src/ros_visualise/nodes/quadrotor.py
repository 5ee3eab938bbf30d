"""The node of a simulated quadrotor."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ros_visualise.data import (
    FluidPressure,
    Image,
    Imu,
    MagneticField,
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
from ros_visualise.simulation.settings import QuadrotorParams
from ros_visualise.simulation.source import SimulatedRobot
from ros_visualise.sources.playback import Playback

_OUTPUTS = {
    "image": Image,
    "imu": Imu,
    "fix": NavSatFix,
    "odom": Odometry,
    "truth": Odometry,
    "points": PointCloud,
    "mag": MagneticField,
    "pressure": FluidPressure,
    "tf": Transforms,
    "tf_static": Transforms,
    "robot_description": Text,
}


@dataclass(frozen=True)
class QuadrotorNodeParams(QuadrotorParams):
    """Where it is, what it is to do, and its sensors."""

    world: str = param("field", "plane, playpen or field", restart=True)
    mission: str = param(
        "none", "square, figure_of_eight, lawn_mower, default, a YAML file, or none", restart=True
    )
    seed: int = param(0, "of all random errors", min=0, max=2**31 - 1, restart=True)


@source(
    "quadrotor",
    params=QuadrotorNodeParams,
    inputs={"cmd_vel": Twist, "goal": PoseStamped},
    outputs=_OUTPUTS,
    latched=("tf_static", "robot_description"),
    makes_time=True,
)
class Quadrotor:
    """A simulated quadrotor that looks down."""

    def __init__(self, params: QuadrotorNodeParams, playback: Playback) -> None:
        self._robot = SimulatedRobot(
            "quadrotor", params.world, params.mission, params.seed, params, playback
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

    @action("rise and stay in the air")
    def take_off(self) -> None:
        """Rise and stay in the air."""
        self._robot.act("take_off")

    @action("come down where it is")
    def land(self) -> None:
        """Come down where it is."""
        self._robot.act("land")

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
