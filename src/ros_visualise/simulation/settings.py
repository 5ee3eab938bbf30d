"""Parameters of a simulated robot: its sensors' rates, noise and layout.

Noise is given by its standard deviation, or as data sheets do by its density: a sample at rate f
has the standard deviation density * sqrt(f). A bias is drawn once per run, and changes by its
random walk. A slow error has a standard deviation and a time constant.
"""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.simulation.missions import SHAPES
from ros_visualise.simulation.sensors import setting
from ros_visualise.simulation.sensors.camera import CameraSensorParams
from ros_visualise.simulation.sensors.gps import GpsParams
from ros_visualise.simulation.sensors.imu import ImuParams
from ros_visualise.simulation.sensors.lidar import LidarParams
from ros_visualise.simulation.sensors.odometry import OdometryParams
from ros_visualise.simulation.sensors.truth import TruthParams
from ros_visualise.simulation.worlds import OURS


@dataclass(frozen=True)
class _CommonParams:
    map_to_odom: bool = setting(
        True,
        "publish the transform from map to odom; switch it off where a navigator does "
        "that: odom_start then stands where odom would be",
    )
    command_timeout: float = setting(
        0.5, "seconds after which a velocity command ends, if no other follows", min=0.05, max=60
    )
    mission_timeout: float = setting(
        30.0, "seconds without progress after which a mission has failed", min=1, max=3600
    )


@dataclass(frozen=True)
class RobotParams(
    LidarParams,  # from the last to the first on the page
    OdometryParams,
    GpsParams,
    ImuParams,
    CameraSensorParams,
    TruthParams,
    _CommonParams,
):
    """Parameters that all robots have."""

    @property
    def gimbal(self) -> bool:
        """A gimbal keeps the camera level."""
        return False


@dataclass(frozen=True)
class ScenarioParams:
    """The world, the mission and the seed of a simulation."""

    world: str = setting("field", f"the world to be in: {OURS}, or another package's")
    mission: str = setting(
        "none",
        "square, figure_of_eight, lawn_mower, default (the robot's own), a YAML file, or none",
        file=lambda mission: mission not in ("", "none", "default", *SHAPES),
    )
    repeat: bool = setting(
        False, "while somebody looks on, start the mission again a few seconds after its end"
    )
    seed: int = setting(
        0, "seed of all random errors; the same seed gives the same data", min=0, max=2**31 - 1
    )
    tf_prefix: str = setting("", "prefix of its frames except map, such as uav1 for uav1/base_link")
