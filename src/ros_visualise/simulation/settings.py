"""Parameters of a simulated robot: rates, noise and layout of its sensors.

Noise is given by its standard deviation, or as in data sheets by its density: a sample at rate f
has the standard deviation density * sqrt(f). A bias is drawn once per run, and changes by its
random walk. A slow error has a standard deviation and a time constant.
"""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.simulation.estimated_state import ControlParams
from ros_visualise.simulation.missions import SHAPES
from ros_visualise.simulation.profiles import Profile, settings_of
from ros_visualise.simulation.sensors import setting
from ros_visualise.simulation.sensors.camera import CameraSensorParams
from ros_visualise.simulation.sensors.gps import GpsParams
from ros_visualise.simulation.sensors.imu import ImuParams
from ros_visualise.simulation.sensors.lidar import LidarParams
from ros_visualise.simulation.sensors.odometry import OdometryParams
from ros_visualise.simulation.sensors.truth import TruthParams
from ros_visualise.simulation.wear import WearParams
from ros_visualise.simulation.worlds import OURS


@dataclass(frozen=True)
class _CommonParams:
    map_to_odom: bool = setting(
        True,
        "publish the transform from map to odom; switch this off if a navigator publishes that"
        " transform (the simulator then uses the frame odom_start in place of odom)",
    )
    command_timeout: float = setting(
        0.5, "how long a velocity command holds unless repeated, seconds", min=0.05, max=60
    )
    mission_delay: float = setting(
        0.0, "time at rest before the first mission, seconds", min=0, max=3600
    )
    mission_timeout: float = setting(
        30.0, "time without progress after which a mission fails, seconds", min=1, max=3600
    )


@dataclass(frozen=True)
class RobotParams(
    LidarParams,  # from the last to the first on the page
    OdometryParams,
    GpsParams,
    ImuParams,
    CameraSensorParams,
    TruthParams,
    WearParams,
    ControlParams,
    _CommonParams,
):
    """Parameters of all robots."""


@dataclass(frozen=True)
class ScenarioParams:
    """World, profile, mission and seed of a simulation."""

    world: str = setting("field", f"world: {OURS}, or one from a plug-in")
    profile: Profile = setting(
        Profile.IDEAL,
        "errors of sensors and world: a preset of the other parameters, from ideal to hard",
        preset=settings_of,
    )
    mission: str = setting(
        "none",
        "square, figure_of_eight, lawn_mower, default (the robot's own), a YAML file, or none",
        file=lambda mission: mission not in ("", "none", "default", *SHAPES),
    )
    repeat: bool = setting(
        False, "while someone views the mission, restart it a few seconds after it ends"
    )
    seed: int = setting(
        0, "seed of all random errors; the same seed gives the same data", min=0, max=2**31 - 1
    )
    tf_prefix: str = setting(
        "", "prefix of the robot's frames (except map), such as uav1 for uav1/base_link"
    )
