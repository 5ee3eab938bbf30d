"""Kinds of messages in the scene."""

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
"""Type of messages -> its drawing."""
CAMERAS = (Image, CameraInfo)
HELD = (Text, JointState, Marker, MarkerArray, NavSatFix)
"""Messages that count later too: all are taken, even while no browser is connected."""


def is_spatial(kind: type) -> bool:
    """True if such messages need a view in 3D: images and texts alone do not."""
    return (kind in DRAWINGS and kind not in (*CAMERAS, Text)) or kind is Transforms


def is_track(kinds: Mapping[str, type]) -> bool:
    """True if all that these topics show in 3D is a track, as of a video with telemetry."""
    return all(kind in (NavSatFix, Imu, Path) for kind in kinds.values() if is_spatial(kind))


def is_tree(kinds: Mapping[str, type]) -> bool:
    """True if all that these topics show in 3D are frames."""
    spatial = [kind for kind in kinds.values() if is_spatial(kind)]
    return bool(spatial) and all(kind is Transforms for kind in spatial)


def is_beside_image(topic: str, kinds: Mapping[str, type]) -> bool:
    """True if a topic is the calibration of images beside it, or of several below it."""
    return kinds[topic] is CameraInfo and any(
        kind is Image and topic in (info_topic(name), f"{name.rpartition('/')[0]}/camera_info")
        for name, kind in kinds.items()
    )
