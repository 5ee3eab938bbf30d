"""What can be set on a simulated robot: its sensors' rates, noise and layout.

Noise is given as its standard deviation. ``..._density`` is that of white noise by the root of its
bandwidth, as data sheets have it: a sample at rate f has density * sqrt(f). A bias is drawn once
per run, its walk goes on from there; of slow errors the deviation and the time constant are given.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ros_visualise.params import param


def setting(default: Any, help: str, **limits: Any) -> Any:
    """A parameter that sets the robot down anew when it changes; as `param`."""
    return param(default, help, restart=True, **limits)


@dataclass(frozen=True)
class RobotParams:
    """What both robots have."""

    command_timeout: float = setting(
        0.5, "seconds after which a velocity command is forgotten", min=0.05, max=60
    )
    mission_timeout: float = setting(
        30.0, "seconds without progress after which a mission is given up", min=1, max=3600
    )
    truth_rate: float = setting(50.0, "ground truth, messages a second", min=0.1, max=200)

    camera: bool = setting(True, "the camera is on", group="camera")
    camera_rate: float = setting(10.0, "images a second", min=0.1, max=60, group="camera")
    camera_width: int = setting(640, "pixels", min=16, max=4096, group="camera")
    camera_height: int = setting(480, "pixels", min=16, max=4096, group="camera")
    camera_fov: float = setting(80.0, "horizontal, degrees", min=10, max=150, group="camera")
    camera_pitch: float = setting(0.0, "down from ahead, degrees", min=-90, max=90, group="camera")
    camera_noise: float = setting(2.0, "of a pixel, of 255", min=0, max=50, group="camera")

    imu_rate: float = setting(100.0, "measurements a second", min=1, max=200, group="imu")
    gyro_density: float = setting(3e-4, "rad/s/sqrt(Hz)", min=0, max=0.1, group="imu")
    gyro_bias: float = setting(5e-3, "rad/s", min=0, max=0.5, group="imu")
    gyro_walk: float = setting(2e-5, "of the bias, rad/s^2/sqrt(Hz)", min=0, max=0.01, group="imu")
    accel_density: float = setting(2e-3, "m/s^2/sqrt(Hz)", min=0, max=1, group="imu")
    accel_bias: float = setting(0.05, "m/s^2", min=0, max=5, group="imu")
    accel_walk: float = setting(2e-4, "of the bias, m/s^3/sqrt(Hz)", min=0, max=0.1, group="imu")
    imu_attitude: float = setting(
        0.01, "slow error of each angle, rad", min=0, max=0.5, group="imu"
    )
    imu_attitude_time: float = setting(30.0, "its time, seconds", min=0.1, max=1e4, group="imu")

    gps: bool = setting(True, "the GPS receiver is on", group="gps")
    gps_rate: float = setting(5.0, "fixes a second", min=0.1, max=50, group="gps")
    gps_noise: float = setting(0.15, "white, east and north, m", min=0, max=100, group="gps")
    gps_drift: float = setting(0.8, "slow error, east and north, m", min=0, max=100, group="gps")
    gps_drift_time: float = setting(60.0, "its time, seconds", min=0.1, max=1e5, group="gps")
    gps_vertical: float = setting(2.0, "up is so many times worse", min=0, max=10, group="gps")
    gps_latitude: float = setting(
        49.0, "of the world's origin, degrees", min=-89, max=89, group="gps"
    )
    gps_longitude: float = setting(8.4, "of it, degrees", min=-180, max=180, group="gps")
    gps_altitude: float = setting(116.0, "of it, m", min=-500, max=9000, group="gps")

    odom_rate: float = setting(50.0, "messages a second", min=1, max=200, group="odometry")
    odom_scale: float = setting(0.01, "error of the scale, of 1", min=0, max=0.5, group="odometry")
    odom_noise: float = setting(0.01, "growing, m/sqrt(m)", min=0, max=1, group="odometry")

    lidar: bool = setting(True, "the lidar is on", group="lidar")
    lidar_rate: float = setting(10.0, "scans a second", min=0.1, max=50, group="lidar")
    lidar_rings: int = setting(16, "rows of rays", min=1, max=128, group="lidar")
    lidar_columns: int = setting(900, "rays in a row", min=1, max=4096, group="lidar")
    lidar_low: float = setting(-15.0, "lowest row, degrees", min=-89, max=89, group="lidar")
    lidar_high: float = setting(15.0, "highest row, degrees", min=-89, max=89, group="lidar")
    lidar_near: float = setting(0.5, "shortest range, m", min=0, max=10, group="lidar")
    lidar_far: float = setting(100.0, "longest range, m", min=1, max=1000, group="lidar")
    lidar_noise: float = setting(0.02, "of a range, m", min=0, max=1, group="lidar")


@dataclass(frozen=True)
class HuskyParams(RobotParams):
    """The rover."""

    odom_turn_scale: float = setting(
        0.02, "error of the scale of turns, of 1", min=0, max=0.5, group="odometry"
    )
    odom_turn_noise: float = setting(0.01, "growing, rad/sqrt(rad)", min=0, max=1, group="odometry")


@dataclass(frozen=True)
class QuadrotorParams(RobotParams):
    """The quadrotor."""

    camera_pitch: float = setting(90.0, "down from ahead, degrees", min=-90, max=90, group="camera")
    camera_gimbal: bool = setting(
        True, "the camera keeps level while the body rolls and pitches", group="camera"
    )
    odom_scale: float = setting(0.005, "error of the scale, of 1", min=0, max=0.5, group="odometry")
    odom_noise: float = setting(0.02, "growing, m/sqrt(m)", min=0, max=1, group="odometry")
    odom_yaw_noise: float = setting(0.003, "growing, rad/sqrt(m)", min=0, max=1, group="odometry")
    lidar: bool = setting(False, "the lidar is on", group="lidar")

    mag_rate: float = setting(50.0, "measurements a second", min=1, max=200, group="magnetometer")
    mag_noise: float = setting(0.3, "white, microtesla", min=0, max=100, group="magnetometer")
    mag_bias: float = setting(1.0, "of each axis, microtesla", min=0, max=100, group="magnetometer")
    mag_strength: float = setting(
        48.6, "of the Earth's field, microtesla", min=1, max=100, group="magnetometer"
    )
    mag_inclination: float = setting(
        64.8, "down from level, degrees", min=-90, max=90, group="magnetometer"
    )
    mag_declination: float = setting(
        2.9, "east of north, degrees", min=-180, max=180, group="magnetometer"
    )

    baro_rate: float = setting(25.0, "measurements a second", min=1, max=200, group="barometer")
    baro_noise: float = setting(1.5, "white, Pa", min=0, max=1000, group="barometer")
    baro_drift: float = setting(8.0, "slow error, Pa", min=0, max=1000, group="barometer")
    baro_drift_time: float = setting(
        300.0, "its time, seconds", min=0.1, max=1e5, group="barometer"
    )


@dataclass(frozen=True)
class ScenarioParams:
    """Where a robot is, and what it is to do."""

    world: str = setting("field", "plane, playpen or field")
    mission: str = setting(
        "none", "square, figure_of_eight, lawn_mower, default, a YAML file, or none"
    )
    seed: int = setting(0, "of all random errors", min=0, max=2**31 - 1)
    tf_prefix: str = setting("", "of its frames, but map: uav1 for uav1/base_link")
