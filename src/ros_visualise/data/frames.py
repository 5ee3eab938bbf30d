"""Transforms between frames, as tf carries them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ros_visualise.data import ros_fields as ros
from ros_visualise.data.header import Floats, Header
from ros_visualise.data.ros_fields import TabledMessage


@dataclass(frozen=True, eq=False)
class TransformStamped(TabledMessage):
    """Pose of the frame ``child_frame_id`` in the frame of the header: T_parent_child.

    ``translation_xyz`` (3,) in metres and ``quat_xyzw`` (4,) take points of the child frame to the
    frame of the header.
    """

    type_name: ClassVar[str] = "geometry_msgs/msg/TransformStamped"
    ros_fields: ClassVar[ros.RosFields] = {
        "header": ros.HEADER,
        **ros.plain(child_frame_id=str),
        "transform": ros.Part(
            "geometry_msgs/msg/Transform",
            translation=ros.vector("translation_xyz"),
            rotation=ros.quaternion("quat_xyzw"),
        ),
    }

    child_frame_id: str
    translation_xyz: Floats
    quat_xyzw: Floats
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class Transforms(TabledMessage):
    """Several transforms sent at once, as on ``/tf``."""

    type_name: ClassVar[str] = "tf2_msgs/msg/TFMessage"
    also_read: ClassVar[tuple[str, ...]] = ("tf/msg/tfMessage",)
    plotted: ClassVar[bool] = False
    ros_fields: ClassVar[ros.RosFields] = {
        "transforms": ros.several("transforms", TransformStamped),
    }

    transforms: tuple[TransformStamped, ...]

    @property
    def header(self) -> Header:
        """Header of the first transform; empty without any."""
        return self.transforms[0].header if self.transforms else Header()


def is_static(topic: str) -> bool:
    """True if the transforms on a topic hold at all times, by its name."""
    return topic.rstrip("/").endswith("tf_static")
