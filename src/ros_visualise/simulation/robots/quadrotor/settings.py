"""Parameters of the quadrotor."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from ros_visualise.simulation.camera_mount import GimbalParams
from ros_visualise.simulation.pad import PadParams
from ros_visualise.simulation.robots.quadrotor.wind import WindParams
from ros_visualise.simulation.sensors import setting
from ros_visualise.simulation.sensors.barometer import BarometerParams
from ros_visualise.simulation.sensors.magnetometer import MagnetometerParams
from ros_visualise.simulation.sensors.odometry import VisualOdometryParams
from ros_visualise.simulation.sensors.optical_flow import OpticalFlowParams
from ros_visualise.simulation.sensors.rangefinder import RangefinderParams
from ros_visualise.simulation.settings import RobotParams, ScenarioParams

_camera = partial(setting, group="camera")


@dataclass(frozen=True)
class _DownwardCameraParams(GimbalParams, RobotParams):
    camera_pitch: float = _camera(
        90.0, "pitch of the camera: 0 ahead, 90 straight down, degrees", min=-90, max=90
    )
    lidar: bool = setting(False, "switch the lidar on", group="lidar")


@dataclass(frozen=True)
class QuadrotorParams(
    PadParams,  # from the last to the first on the page
    WindParams,
    OpticalFlowParams,
    RangefinderParams,
    BarometerParams,
    MagnetometerParams,
    VisualOdometryParams,
    _DownwardCameraParams,
):
    """Sensors, wind and landing pad of the quadrotor."""


@dataclass(frozen=True)
class QuadrotorNodeParams(ScenarioParams, QuadrotorParams):
    """World, mission and sensors of the quadrotor."""
