"""The frames of a simulated robot (REP 105), as transforms.

``map`` is the world. ``odom`` is the robot's start and never moves, as nothing corrects the
odometry. If a navigator publishes ``odom``, ``odom_start`` takes its place here. ``base_link`` in
``odom`` is the pose by odometry, so it drifts; the true pose is only on the ground truth topic.
``pad_deck`` is the true pose of a landing pad, for drawing it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np

from ros_visualise.data import (
    Floats,
    Header,
    Image,
    MarkerArray,
    Odometry,
    Text,
    Transforms,
    TransformStamped,
)
from ros_visualise.simulation.attitude import (
    Quat,
    Vector,
    from_yaw,
    xyzw,
    yaw_of,
)
from ros_visualise.simulation.camera_mount import TO_OPTICAL, CameraMount
from ros_visualise.simulation.model import BASE, bodies_of_robot, site_position, standing_height

MAP, ODOM, ODOM_START, DECK = "map", "odom", "odom_start", "pad_deck"
_LEVEL = (1.0, 0.0, 0.0, 0.0)
_SITES = ("imu_link", "gps_link", "lidar_link")


def fixed_frames(
    model: Any,
    mount: CameraMount,
    start: tuple[Vector, Quat],
    odom: str = ODOM,
    sensors: Mapping[str, tuple[Floats, Quat]] = MappingProxyType({}),
) -> Transforms:
    """All constant transforms, for ``tf_static``.

    Args:
        start: pose of ``base_link`` in ``map`` at the start.
        odom: name of the frame at the start.
        sensors: further frames -> position and attitude in ``base_link``.
    """
    place, attitude = start
    heading = from_yaw(yaw_of(attitude))
    frames = [
        _transform(0, MAP, odom, np.array(place), heading),
        _transform(
            0, BASE, "base_footprint", np.array([0.0, 0.0, -standing_height(model)]), _LEVEL
        ),
        *(_transform(0, BASE, name, site_position(model, name), _LEVEL) for name in _SITES),
        *(_transform(0, BASE, name, *mounted) for name, mounted in sensors.items()),
        _transform(0, "camera_link", "camera_optical", np.zeros(3), TO_OPTICAL),
        *_wheel_frames(model),
    ]
    if not mount.moves:
        frames.append(camera_frame(0, mount))
    return Transforms(tuple(frames))


def _wheel_frames(model: Any) -> list[TransformStamped]:
    """Frames of the wheels; they do not turn, as no joint states are published."""
    frames = []
    for number in bodies_of_robot(model)[1:]:
        body = model.body(number)
        frames.append(_transform(0, BASE, f"{body.name}_link", np.array(body.pos), _LEVEL))
    return frames


def body_frame(odometry: Odometry) -> TransformStamped:
    """``base_link`` in ``odom``."""
    o = odometry
    return TransformStamped(o.child_frame_id, o.position_xyz, o.quat_xyzw, o.header)


def camera_frame(stamp_ns: int, mount: CameraMount) -> TransformStamped:
    """``camera_link`` in ``base_link``, as the mount reports it."""
    return _transform(stamp_ns, BASE, "camera_link", mount.position, mount.reported(stamp_ns))


def deck_frame(stamp_ns: int, position: Vector, attitude: Quat) -> TransformStamped:
    """``pad_deck`` in ``map``."""
    return _transform(stamp_ns, MAP, DECK, np.array(position), attitude)


def _transform(stamp_ns: int, parent: str, child: str, at: Floats, turn: Quat) -> TransformStamped:
    return TransformStamped(child, at, xyzw(turn), Header(stamp_ns, parent))


def prefixed(message: Any, prefix: str) -> Any:
    """A message with prefixed frames, such as ``uav1/base_link``, for several robots.

    They share ``map``, which has no prefix.
    """
    if not prefix:
        return message
    if isinstance(message, MarkerArray):
        return MarkerArray(tuple(prefixed(one, prefix) for one in message.markers))
    if isinstance(message, Text):  # a description or a status
        is_urdf = message.text.startswith("<")
        return Text(_prefixed_urdf(message.text, prefix)) if is_urdf else message
    if isinstance(message, Transforms):
        return Transforms(tuple(prefixed(one, prefix) for one in message.transforms))
    header = Header(message.header.stamp_ns, _prefixed_frame(message.header.frame_id, prefix))
    changed: dict[str, Any] = {"header": header}
    if isinstance(message, Odometry | TransformStamped):
        changed["child_frame_id"] = _prefixed_frame(message.child_frame_id, prefix)
    if isinstance(message, Image) and message.camera_info is not None:
        changed["camera_info"] = replace(message.camera_info, header=header)
    return replace(message, **changed)


def _prefixed_frame(frame: str, prefix: str) -> str:
    return frame if frame == MAP else f"{prefix.strip('/')}/{frame}"


def _prefixed_urdf(text: str, prefix: str) -> str:
    """A description with prefixed links, which are named like their frames."""
    robot = Xml.fromstring(text)
    for link in robot.iter("link"):
        link.set("name", _prefixed_frame(link.get("name", ""), prefix))
    for end in (*robot.iter("parent"), *robot.iter("child")):
        end.set("link", _prefixed_frame(end.get("link", ""), prefix))
    return Xml.tostring(robot, encoding="unicode")
