"""The parameters of the navigator, as people set them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import param
from ros_visualise.landmarks.map_params import MapParams
from ros_visualise.landmarks.navigation.gps import GpsNoise
from ros_visualise.landmarks.navigation.imu import ImuNoise
from ros_visualise.landmarks.navigation.landmark_map import MapMode, MapRules
from ros_visualise.landmarks.navigation.motion import OdometryNoise
from ros_visualise.landmarks.navigation.points import GroundPlane
from ros_visualise.landmarks.navigation.sensor_buffer import SensorNoise
from ros_visualise.landmarks.navigation.settings import NavigatorSettings


@dataclass(frozen=True)
class OdometryErrorParams:
    """Parameters of odometry errors."""

    odom_scale: float = param(
        0.01,
        "constant scale error of all distances (standard deviation), as a fraction: 0.01 is 1%",
        min=0,
        max=1,
        slider=(0, 0.1),
        group="odometry",
    )
    odom_turn_scale: float = param(
        0.0,
        "constant scale error of all rotations (standard deviation), as a fraction; wheels: 0.02",
        min=0,
        max=1,
        slider=(0, 0.1),
        group="odometry",
    )
    odom_noise: float = param(
        0.02,
        "position error, growing with the distance (standard deviation), m/sqrt(m)",
        min=1e-5,
        max=10,
        slider=(0, 0.2),
        group="odometry",
    )
    odom_heading_noise: float = param(
        0.2,
        "heading error, growing with the distance (standard deviation), deg/sqrt(m)",
        min=1e-5,
        max=90,
        slider=(0, 5),
        group="odometry",
    )
    odom_tilt_noise: float = param(
        0.02,
        "roll and pitch error, growing with the distance (standard deviation), deg/sqrt(m)",
        min=0,
        max=90,
        slider=(0, 5),
        group="odometry",
    )
    odom_still_noise: float = param(
        0.001,
        "position error, growing with time even at standstill (standard deviation), m/sqrt(s)",
        min=0,
        max=10,
        slider=(0, 0.1),
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
    )
    max_speed: float = param(
        30.0,
        "largest speed of the robot, m/s; faster odometry has jumped",
        min=0.1,
        max=1000,
        slider=(1, 50),
        group="odometry",
    )


@dataclass(frozen=True)
class ImuErrorParams:
    """Parameters of IMU errors."""

    imu: bool = param(
        True, "use the IMU if available; switch it off if the odometry already uses it", group="imu"
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


@dataclass(frozen=True)
class GpsErrorParams:
    """Parameters of GPS errors."""

    gps: bool = param(True, "use GPS if available", group="gps")
    gps_origin: str = param(
        "",
        "latitude, longitude, altitude of the origin of a map whose x axis points east, "
        "such as 49.0, 8.4, 116; empty: estimated from the fixes",
        group="gps",
    )
    gps_sigma: float = param(
        2.0,
        "standard deviation east and north if the receiver reports none, m",
        min=1e-3,
        max=1000,
        slider=(0.01, 10),
        group="gps",
    )
    gps_slow: float = param(
        0.97,
        "slowly changing fraction of a fix's variance; the rest is white noise",
        min=0,
        max=0.999,
        group="gps",
    )
    gps_time: float = param(
        60.0,
        "time constant of the slow part, seconds",
        min=0.1,
        max=1e5,
        slider=(1, 600),
        group="gps",
    )

    def __post_init__(self) -> None:
        """Reject an invalid origin."""
        _ = self.origin

    @property
    def origin(self) -> tuple[float, float, float] | None:
        """The position given by `gps_origin`.

        Raises:
            ParameterError: it is invalid.
        """
        if not self.gps_origin.strip():
            return None
        try:
            latitude, longitude, altitude = map(float, self.gps_origin.split(","))
        except ValueError:
            latitude = longitude = altitude = math.nan
        if not (abs(latitude) <= 90 and abs(longitude) <= 180 and math.isfinite(altitude)):
            raise ParameterError(
                f"gps_origin={self.gps_origin}: give latitude, longitude, altitude: 49.0, 8.4, 116"
            )
        return latitude, longitude, altitude


@dataclass(frozen=True)
class NavigatorParams(MapParams, GpsErrorParams, ImuErrorParams, OdometryErrorParams):
    """Parameters of `LandmarkNavigator`."""

    mode: MapMode = param(
        MapMode.BUILD,
        "use of the map: build a new one, extend the given one, or leave it unchanged (frozen)",
    )
    min_sightings: int = param(
        5,
        "sightings needed before a new landmark corrects the robot",
        min=1,
        max=1000,
        slider=(1, 20),
        group="map",
    )
    min_parallax: float = param(
        0.1,
        "smallest distance between those sightings, as a fraction of the landmark's range",
        min=0,
        max=10,
        slider=(0, 1),
        group="map",
    )
    corner_floor: float = param(
        0.1,
        "smallest corner error (standard deviation), pixels; real cameras may need 0.3",
        min=0,
        max=10,
        slider=(0, 2),
        group="camera",
    )
    delay: float = param(
        0.5,
        "longest delay of images and their detections, seconds",
        min=0.01,
        max=60,
        slider=(0.1, 2),
        group="camera",
    )

    def settings(self) -> NavigatorSettings:
        """The same in the units of the filter."""
        odometry = OdometryNoise(
            self.odom_scale,
            self.odom_turn_scale,
            self.odom_noise,
            math.radians(self.odom_heading_noise),
            math.radians(self.odom_tilt_noise),
            self.odom_still_noise,
        )
        imu = ImuNoise(
            self.gyro_density,
            self.accel_density,
            self.gyro_bias,
            self.accel_bias,
            self.gyro_walk,
            self.accel_walk,
        )
        gps = GpsNoise(self.gps_sigma, self.gps_slow, self.gps_time, self.origin)
        plane = GroundPlane(self.ground_height, self.ground_sigma) if self.ground else None
        return NavigatorSettings(
            MapRules(self.mode, self.min_sightings, self.min_parallax, plane),
            SensorNoise(odometry, imu, gps),
            math.radians(self.level_sigma),
            self.delay,
            self.max_speed,
        )
