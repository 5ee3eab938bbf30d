"""Parameters of a simulated robot: its sensors' rates, noise and layout.

Noise is given by its standard deviation, or as data sheets do by its density: a sample at rate f
has the standard deviation density * sqrt(f). A bias is drawn once per run, and changes by its
random walk. A slow error has a standard deviation and a time constant.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

from ros_visualise.params import param
from ros_visualise.simulation.missions import SHAPES
from ros_visualise.simulation.worlds import OURS


def setting(default: Any, help: str, **limits: Any) -> Any:
    """A parameter, as `param`; a change starts the simulation anew."""
    return param(default, help, restart=True, **limits)


_camera = partial(setting, group="camera")
_imu = partial(setting, group="imu")
_gps = partial(setting, group="gps")
_odometry = partial(setting, group="odometry")
_lidar = partial(setting, group="lidar")


@dataclass(frozen=True)
class RobotParams:
    """Parameters that all robots have."""

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
    truth_rate: float = setting(
        50.0, "messages per second of the true pose (ground truth)", min=0.1, max=200
    )

    camera: bool = _camera(True, "switch the camera on")
    camera_rate: float = _camera(10.0, "images per second", min=0.1, max=60)
    camera_width: int = _camera(640, "width of the images, pixels", min=16, max=4096)
    camera_height: int = _camera(480, "height of the images, pixels", min=16, max=4096)
    camera_fov: float = _camera(80.0, "horizontal field of view, degrees", min=10, max=150)
    camera_pitch: float = _camera(
        0.0, "how far the camera looks down: 0 ahead, 90 straight down, degrees", min=-90, max=90
    )
    camera_noise: float = _camera(
        2.0, "noise of each pixel (standard deviation), levels of 255", min=0, max=50
    )

    imu_rate: float = _imu(100.0, "measurements per second", min=1, max=200)
    gyro_density: float = _imu(
        3e-4, "noise density of the gyroscope, rad/s/sqrt(Hz)", min=0, max=0.1
    )
    gyro_bias: float = _imu(
        5e-3, "bias of the gyroscope (standard deviation), rad/s", min=0, max=0.5
    )
    gyro_walk: float = _imu(
        2e-5, "random walk of the gyroscope's bias, rad/s^2/sqrt(Hz)", min=0, max=0.01
    )
    accel_density: float = _imu(
        2e-3, "noise density of the accelerometer, m/s^2/sqrt(Hz)", min=0, max=1
    )
    accel_bias: float = _imu(
        0.05, "bias of the accelerometer (standard deviation), m/s^2", min=0, max=5
    )
    accel_walk: float = _imu(
        2e-4, "random walk of the accelerometer's bias, m/s^3/sqrt(Hz)", min=0, max=0.1
    )
    imu_attitude: float = _imu(
        0.01, "slow error of the attitude about each axis (standard deviation), rad", min=0, max=0.5
    )
    imu_attitude_time: float = _imu(
        30.0, "time constant of the attitude's slow error, seconds", min=0.1, max=1e4
    )

    gps: bool = _gps(True, "switch the GPS receiver on")
    gps_rate: float = _gps(5.0, "fixes per second", min=0.1, max=50)
    gps_noise: float = _gps(
        0.15, "white noise east and north (standard deviation), m", min=0, max=100
    )
    gps_drift: float = _gps(
        0.8, "slow error east and north (standard deviation), m", min=0, max=100
    )
    gps_drift_time: float = _gps(60.0, "time constant of the slow error, seconds", min=0.1, max=1e5)
    gps_vertical: float = _gps(2.0, "how many times larger the errors are in height", min=0, max=10)
    gps_latitude: float = _gps(49.0, "latitude of the world's origin, degrees", min=-89, max=89)
    gps_longitude: float = _gps(8.4, "longitude of the world's origin, degrees", min=-180, max=180)
    gps_altitude: float = _gps(116.0, "altitude of the world's origin, m", min=-500, max=9000)

    odom_rate: float = _odometry(50.0, "messages per second", min=1, max=200)
    odom_scale: float = _odometry(
        0.01,
        "error of all distances (standard deviation), as a fraction: 0.01 is 1%",
        min=0,
        max=0.5,
    )
    odom_noise: float = _odometry(
        0.01, "error of the position that grows with the distance, m/sqrt(m)", min=0, max=1
    )

    lidar: bool = _lidar(True, "switch the lidar on")
    lidar_rate: float = _lidar(10.0, "scans per second", min=0.1, max=50)
    lidar_rings: int = _lidar(16, "rows of rays, one above another", min=1, max=128)
    lidar_columns: int = _lidar(900, "rays in a row, all around", min=1, max=4096)
    lidar_low: float = _lidar(-15.0, "elevation of the lowest row, degrees", min=-89, max=89)
    lidar_high: float = _lidar(15.0, "elevation of the highest row, degrees", min=-89, max=89)
    lidar_near: float = _lidar(0.5, "shortest range that is measured, m", min=0, max=10)
    lidar_far: float = _lidar(100.0, "longest range that is measured, m", min=1, max=1000)
    lidar_noise: float = _lidar(0.02, "noise of each range (standard deviation), m", min=0, max=1)

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
