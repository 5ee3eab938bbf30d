"""A prefix of a robot's frames, for several robots in one tree of frames."""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from xml.etree import ElementTree as Xml

from ros_visualise.data import (
    Header,
    Image,
    MarkerArray,
    Odometry,
    Text,
    Transforms,
    TransformStamped,
)
from ros_visualise.simulation.frames import MAP


def prefixed(message: Any, prefix: str) -> Any:
    """A message in the frames of one of several robots: ``uav1/base_link``.

    The ``map`` is that of all of them, and has no prefix.
    """
    if not prefix:
        return message
    if isinstance(message, MarkerArray):
        return MarkerArray(tuple(prefixed(one, prefix) for one in message.markers))
    if isinstance(message, Text):  # a description, or what the robot does
        is_urdf = message.text.startswith("<")
        return Text(_prefixed_urdf(message.text, prefix)) if is_urdf else message
    if isinstance(message, Transforms):
        return Transforms(tuple(prefixed(one, prefix) for one in message.transforms))
    header = Header(message.header.stamp_ns, _name(message.header.frame_id, prefix))
    changed: dict[str, Any] = {"header": header}
    if isinstance(message, Odometry | TransformStamped):
        changed["child_frame_id"] = _name(message.child_frame_id, prefix)
    if isinstance(message, Image) and message.camera_info is not None:
        changed["camera_info"] = replace(message.camera_info, header=header)
    return replace(message, **changed)


def _name(frame: str, prefix: str) -> str:
    return frame if frame == MAP else f"{prefix.strip('/')}/{frame}"


def _prefixed_urdf(text: str, prefix: str) -> str:
    """A description with the names of its links prefixed, which are those of its frames."""
    robot = Xml.fromstring(text)
    for link in robot.iter("link"):
        link.set("name", _name(link.get("name", ""), prefix))
    for end in (*robot.iter("parent"), *robot.iter("child")):
        end.set("link", _name(end.get("link", ""), prefix))
    return Xml.tostring(robot, encoding="unicode")
