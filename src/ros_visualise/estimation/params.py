"""The parameters of the navigator, as people set them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from ros_visualise.core.params import param, specs
from ros_visualise.estimation.imu import ImuNoise
from ros_visualise.estimation.initial_pose import InitialPose, pose_of_text
from ros_visualise.estimation.landmark_map import MapMode, MapRules
from ros_visualise.estimation.odometry import OdometryNoise
from ros_visualise.estimation.points import GroundPlane
from ros_visualise.estimation.sensors import SENSORS
from ros_visualise.estimation.settings import CAMERA_TURN, CameraErrors, NavigatorSettings
from ros_visualise.landmarks.map_params import MapParams
from ros_visualise.sources.calibration import read_uncertainty


@dataclass(frozen=True)
class OdometryErrorParams:
    """Parameters of odometry errors."""

    odom_scale: float = param(
        0.01,
        "initial scale error of all distances (standard deviation), as a fraction: 0.01 is 1%",
        min=0,
        max=1,
        slider=(0, 0.1),
        group="odometry",
    )
    odom_turn_scale: float = param(
        0.02,
        "initial scale error of all rotations (standard deviation), as a fraction",
        min=0,
        max=1,
        slider=(0, 0.1),
        group="odometry",
    )
    odom_scale_walk: float = param(
        0.001,
        "growth of both scale errors with distance (standard deviation), 1/sqrt(m)",
        min=0,
        max=0.1,
        slider=(0, 0.01),
        group="odometry",
    )
    odom_noise: float = param(
        0.02,
        "growth of the position error with distance (standard deviation), m/sqrt(m)",
        min=1e-5,
        max=10,
        slider=(0, 0.2),
        group="odometry",
    )
    odom_heading_noise: float = param(
        0.2,
        "growth of the heading error with distance (standard deviation), deg/sqrt(m)",
        min=1e-5,
        max=90,
        slider=(0, 5),
        group="odometry",
    )
    odom_turn_noise: float = param(
        3.0,
        "growth of the heading error with rotation, from wheel slip (standard deviation),"
        " deg/sqrt(rad)",
        min=0,
        max=90,
        slider=(0, 10),
        group="odometry",
    )
    odom_tilt_noise: float = param(
        0.02,
        "growth of the roll and pitch error with distance (standard deviation), deg/sqrt(m)",
        min=0,
        max=90,
        slider=(0, 5),
        group="odometry",
    )
    odom_still_noise: float = param(
        0.001,
        "growth of the position error with time, even at rest (standard deviation), m/sqrt(s)",
        min=0,
        max=10,
        slider=(0, 0.1),
        group="odometry",
    )
    odom_axes: float = param(
        0.5,
        "misalignment between the axes of the odometry and of the robot (standard deviation),"
        " degrees; wheels follow the ground even if the body tilts",
        min=0,
        max=45,
        slider=(0, 5),
        group="odometry",
    )
    level_sigma: float = param(
        0.5,
        "tilt of the odometry's frame and of a given map (standard deviation), degrees; "
        "90: unknown",
        min=0.01,
        max=90,
        slider=(0.1, 10),
        group="odometry",
        restart=True,
    )
    max_speed: float = param(
        30.0,
        "largest speed of the robot, m/s; faster odometry counts as a jump",
        min=0.1,
        max=1000,
        slider=(1, 50),
        group="odometry",
    )


@dataclass(frozen=True)
class ImuErrorParams:
    """Parameters of IMU errors."""

    imu: bool = param(
        True,
        "use the IMU if available; turn this off if the odometry already uses the IMU",
        group="imu",
    )
    gyro_density: float = param(
        5e-4, "gyroscope noise density, rad/s/sqrt(Hz)", min=1e-7, max=1, group="imu"
    )
    gyro_bias: float = param(
        0.01, "initial gyroscope bias (standard deviation), rad/s", min=0, max=1, group="imu"
    )
    gyro_walk: float = param(
        5e-5, "gyroscope bias random walk, rad/s^2/sqrt(Hz)", min=0, max=0.1, group="imu"
    )
    accel_density: float = param(
        5e-3, "accelerometer noise density, m/s^2/sqrt(Hz)", min=1e-6, max=10, group="imu"
    )
    accel_bias: float = param(
        0.1, "initial accelerometer bias (standard deviation), m/s^2", min=0, max=5, group="imu"
    )
    accel_walk: float = param(
        5e-4, "accelerometer bias random walk, m/s^3/sqrt(Hz)", min=0, max=1, group="imu"
    )
    imu_clock: float = param(
        2e-3,
        "uncertainty of the delay between the IMU's angular rates and odometry (standard"
        " deviation), seconds",
        min=0,
        max=0.5,
        slider=(0, 0.02),
        group="imu",
    )


@dataclass(frozen=True)
class CameraErrorParams:
    """Parameters of errors of a camera that are estimated with the robot's pose."""

    corner_floor: float = param(
        0.3,
        "smallest corner error (standard deviation), pixels; 0.1 for rendered images",
        min=0,
        max=10,
        slider=(0, 2),
        group="camera",
    )
    delay: float = param(
        0.5,
        "maximum delay of a measurement, seconds; a measurement is applied at its own time stamp,"
        " or dropped if it arrives later than this",
        min=0.01,
        max=60,
        slider=(0.1, 2),
        group="camera",
    )
    camera_clock: float = param(
        0.05,
        "standard deviation of the offset of the camera's clock, seconds; unless it is 0, the"
        " offset is estimated",
        min=0,
        max=1,
        slider=(0, 0.2),
        group="camera",
    )
    calibration: str = param(
        "",
        "calibration file written by ros-visualise calibrate; gives the uncertainty of the focal"
        " length",
        group="camera",
        file=bool,
    )
    camera_turn: float = param(
        CAMERA_TURN,
        "standard deviation of the camera's mounting angles, degrees; unless this is 0, the errors"
        " of these angles are estimated",
        min=0,
        max=20,
        slider=(0, 5),
        group="camera",
    )
    camera_turn_time: float = param(
        20.0,
        "time constant in seconds of a varying mounting error (such as a gimbal's); 0: constant",
        min=0,
        max=1e5,
        slider=(0, 100),
        group="camera",
    )
    camera_focal: float = param(
        0.0,
        "estimate an error of the focal length: its standard deviation, as a fraction; 0: do not",
        min=0,
        max=0.5,
        slider=(0, 0.05),
        group="camera",
    )


def _sensor_params() -> type:
    """The parameters of all sensors of `ros_visualise.estimation.sensors`."""
    bases = tuple(reversed([sensor.params for sensor in SENSORS.all()]))
    content = {"__doc__": "Parameters of all sensors.", "__post_init__": _check(bases)}
    return dataclass(frozen=True)(type("SensorParams", bases, content))


def _check(several: Iterable[type]) -> Callable[[Any], None]:
    """A function that lets each of several types check its own parameters."""
    checks = [vars(one)["__post_init__"] for one in several if "__post_init__" in vars(one)]

    def check(params: Any) -> None:
        for one in checks:
            one(params)

    return check


_SensorParams: Any = _sensor_params()


@dataclass(frozen=True)
class NavigatorParams(
    MapParams,
    _SensorParams,  # type: ignore[misc]
    CameraErrorParams,
    ImuErrorParams,
    OdometryErrorParams,
):
    """Parameters of `LandmarkNavigator`."""

    mode: MapMode = param(
        MapMode.BUILD,
        "use of the map: build a new one, extend the given one, or leave it unchanged (frozen)",
        restart=True,
    )
    start: str = param(
        "",
        "initial pose of the robot in the map: x, y, z in metres and yaw in degrees; empty: unknown"
        " (unless given on the topic initialpose)",
        group="map",
        restart=True,
    )
    start_sigma: float = param(
        0.5,
        "standard deviation of the position in 'start', metres",
        min=1e-3,
        max=1e3,
        slider=(0.01, 5),
        group="map",
        restart=True,
    )
    start_yaw_sigma: float = param(
        15.0,
        "standard deviation of the yaw in 'start', degrees",
        min=0.01,
        max=180,
        slider=(1, 90),
        group="map",
        restart=True,
    )
    min_sightings: int = param(
        5,
        "sightings needed before a new landmark is used to correct the robot's pose",
        min=1,
        max=1000,
        slider=(1, 20),
        group="map",
    )
    min_parallax: float = param(
        0.1,
        "minimum distance between the camera positions from which a new landmark is seen, as a"
        " fraction of its range",
        min=0,
        max=10,
        slider=(0, 1),
        group="map",
    )

    ground_roughness: float = param(
        0.05,
        "standard deviation of the ground's height around its mean, metres",
        min=1e-3,
        max=100,
        slider=(0.01, 1),
        group="ground",
    )

    def __post_init__(self) -> None:
        """Reject an invalid start, or parameters of sensors."""
        super().__post_init__()
        _ = self.stated

    def begins_as(self, other: NavigatorParams) -> bool:
        """True if the map and the start are those of other parameters."""
        names = {spec.name for spec in specs(type(self)) if spec.restart}
        unused = set() if self.start.strip() else {"start_sigma", "start_yaw_sigma"}
        return all(getattr(self, name) == getattr(other, name) for name in names - unused)

    @property
    def stated(self) -> InitialPose | None:
        """The initial pose given by `start`.

        Raises:
            ParameterError: it is invalid.
        """
        return pose_of_text(self.start, self.start_sigma, math.radians(self.start_yaw_sigma))

    def settings(self) -> NavigatorSettings:
        """The same in the units of the filter."""
        odometry = OdometryNoise(
            self.odom_scale,
            self.odom_turn_scale,
            self.odom_scale_walk,
            self.odom_noise,
            math.radians(self.odom_heading_noise),
            math.radians(self.odom_tilt_noise),
            self.odom_still_noise,
            axes=math.radians(self.odom_axes),
            turn_walk=math.radians(self.odom_turn_noise),
        )
        imu = ImuNoise(
            self.gyro_density,
            self.accel_density,
            self.gyro_bias,
            self.accel_bias,
            self.gyro_walk,
            self.accel_walk,
            self.imu_clock,
        )
        ground = GroundPlane(self.ground_height, self.ground_sigma, self.ground_roughness)
        plane = ground if self.ground else None
        turn_rad = math.radians(self.camera_turn)
        focal = read_uncertainty(self.calibration).focal if self.calibration else 0.0
        return NavigatorSettings(
            MapRules(self.mode, self.min_sightings, self.min_parallax, plane),
            odometry,
            imu,
            CameraErrors(
                self.camera_clock, turn_rad, self.camera_turn_time, max(self.camera_focal, focal)
            ),
            self.imu,
            math.radians(self.level_sigma),
            self.delay,
            self.max_speed,
            {sensor.name: self for sensor in SENSORS.all()},
        )
