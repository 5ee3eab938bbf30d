"""Which messages are drawn, and as what."""

from __future__ import annotations

from collections.abc import Mapping

from ros_visualise.data import (
    CameraInfo,
    Image,
    Imu,
    JointState,
    Marker,
    MarkerArray,
    NavSatFix,
    Path,
    Text,
    Transforms,
)
from ros_visualise.messages.calibrations import info_topic
from ros_visualise.ui.scene.drawing import Drawing
from ros_visualise.ui.scene.drawings import by_message

DRAWINGS: Mapping[type, type[Drawing]] = by_message()
"""Type of messages -> what draws them."""
CAMERAS = (Image, CameraInfo)
HELD = (Text, Transforms, JointState, Marker, MarkerArray, NavSatFix)
"""What counts later too: all of it is taken, whoever looked on when it came."""


def is_spatial(kind: type) -> bool:
    """Whether such messages need a view in 3D: neither images nor texts do."""
    return (kind in DRAWINGS and kind not in (*CAMERAS, Text)) or kind is Transforms


def is_track(kinds: Mapping[str, type]) -> bool:
    """Whether all that such messages show in 3D is where something went, as of a film."""
    return all(kind in (NavSatFix, Imu, Path) for kind in kinds.values() if is_spatial(kind))


def is_tree(kinds: Mapping[str, type]) -> bool:
    """Whether all that such messages show in 3D are frames."""
    spatial = [kind for kind in kinds.values() if is_spatial(kind)]
    return bool(spatial) and all(kind is Transforms for kind in spatial)


def is_robot(topic: str) -> bool:
    """Whether the texts on a topic describe a robot, as ROS 2 names it."""
    return topic.rstrip("/").endswith("robot_description")


def is_beside_image(topic: str, kinds: Mapping[str, type]) -> bool:
    """Whether a topic is the calibration of images beside it or, of one of several, above it."""
    return kinds[topic] is CameraInfo and any(
        kind is Image and topic in (info_topic(name), f"{name.rpartition('/')[0]}/camera_info")
        for name, kind in kinds.items()
    )
