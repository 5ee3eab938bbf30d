"""Profiles of a simulation: how far its sensors and its world are from ideal.

``ideal`` has the noise and the drift of each sensor, and nothing else. ``realistic`` is a small
aircraft with a good autopilot and camera on a working day; ``hard`` is a cheap one on a bad day.

The values are orders of magnitude of such sensors, not those of one model.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Any


class Profile(Enum):
    """Profile of a simulation."""

    IDEAL = "ideal"
    REALISTIC = "realistic"
    HARD = "hard"


_LEVELS: Mapping[str, tuple[float, float, float]] = {
    # parameter: ideal, realistic, hard
    "camera_k1": (0.0, -0.12, -0.25),
    "camera_k2": (0.0, 0.03, 0.07),
    "camera_p1": (0.0, 0.0005, 0.001),
    "camera_p2": (0.0, -0.0003, -0.001),
    "camera_readout": (0.0, 0.015, 0.03),
    "camera_exposure": (0.0, 0.003, 0.008),
    "camera_noise": (2.0, 3.0, 6.0),
    "camera_misalignment": (0.0, 0.3, 1.0),
    "camera_latency": (0.0, 0.06, 0.15),
    "camera_jitter": (0.0, 0.005, 0.03),
    "camera_dropped": (0.0, 0.01, 0.1),
    "camera_clock_offset": (0.0, 0.005, 0.03),
    "camera_clock_drift": (0.0, 10.0, 50.0),
    "gimbal_error": (0.0, 0.2, 1.0),
    "gimbal_lag": (0.0, 0.01, 0.05),
    "imu_latency": (0.0, 0.003, 0.01),
    "imu_jitter": (0.0, 0.001, 0.005),
    "odom_latency": (0.0, 0.01, 0.04),
    "odom_jitter": (0.0, 0.002, 0.01),
    "odom_scale_drift": (0.0, 0.005, 0.02),
    "odom_stall_every": (0.0, 180.0, 40.0),
    "odom_stall_for": (0.6, 0.3, 0.6),
    "gps_latency": (0.0, 0.12, 0.25),
    "gps_jitter": (0.0, 0.01, 0.05),
    "gps_outage_every": (0.0, 180.0, 40.0),
    "gps_outage_for": (10.0, 8.0, 15.0),
    "gps_jump": (3.0, 2.5, 8.0),
    "gps_jump_every": (0.0, 180.0, 40.0),
    "gps_clock_drift": (0.0, 1.0, 5.0),
    "mag_latency": (0.0, 0.005, 0.02),
    "mag_disturbance": (0.0, 1.5, 6.0),
    "baro_latency": (0.0, 0.02, 0.05),
    "range_latency": (0.0, 0.02, 0.05),
    "range_dropped": (0.0, 0.01, 0.1),
    "flow_latency": (0.0, 0.03, 0.06),
    "flow_dropped": (0.0, 0.02, 0.15),
    "wheel_latency": (0.0, 0.005, 0.02),
    "lidar_latency": (0.0, 0.05, 0.1),
    "tag_dirt": (0.0, 0.03, 0.12),
    "tags_covered": (0.0, 0.1, 0.3),
    "tag_copies": (0, 0, 1),
    "clutter": (0, 6, 20),
    "wind": (0.0, 2.0, 5.0),
}


def settings_of(profile: Profile) -> dict[str, Any]:
    """Parameters that a profile sets -> their values; a robot may lack some of them."""
    column = [*Profile].index(profile)
    return {name: levels[column] for name, levels in _LEVELS.items()}
