"""Transforms between frames, as tf carries them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ros_visualise.core.message import Message
from ros_visualise.data.fields import Fields, header, read_header
from ros_visualise.data.header import Floats, Header, keep
from ros_visualise.data.vectors import named, xyz, xyzw


@dataclass(frozen=True, eq=False)
class TransformStamped(Message):
    """Where the frame ``child_frame_id`` is in the frame of the header: T_parent_child.

    ``translation_xyz`` (3,) in metres and ``quat_xyzw`` (4,) take points of the child frame to the
    frame of the header.
    """

    type_name: ClassVar[str] = "geometry_msgs/msg/TransformStamped"

    child_frame_id: str
    translation_xyz: Floats
    quat_xyzw: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, translation_xyz=(3,), quat_xyzw=(4,))

    def fields(self) -> dict[str, Any]:
        """The fields of a geometry_msgs/msg/TransformStamped."""
        values = {
            "translation": named("geometry_msgs/msg/Vector3", self.translation_xyz),
            "rotation": named("geometry_msgs/msg/Quaternion", self.quat_xyzw),
        }
        return {
            "header": header(self.header),
            "child_frame_id": self.child_frame_id,
            "transform": Fields("geometry_msgs/msg/Transform", values),
        }

    @classmethod
    def read(cls, message: Any) -> TransformStamped:
        """The transform in a geometry_msgs/msg/TransformStamped."""
        return cls(
            child_frame_id=str(message.child_frame_id),
            translation_xyz=np.array(xyz(message.transform.translation)),
            quat_xyzw=np.array(xyzw(message.transform.rotation)),
            header=read_header(message.header),
        )


@dataclass(frozen=True, eq=False)
class Transforms(Message):
    """Several transforms that were sent at once, as on ``/tf``."""

    type_name: ClassVar[str] = "tf2_msgs/msg/TFMessage"
    also_read: ClassVar[tuple[str, ...]] = ("tf/msg/tfMessage",)
    plotted: ClassVar[bool] = False

    transforms: tuple[TransformStamped, ...]

    @property
    def header(self) -> Header:
        """That of the first; of none, an empty one."""
        return self.transforms[0].header if self.transforms else Header()

    def fields(self) -> dict[str, Any]:
        """The fields of a tf2_msgs/msg/TFMessage."""
        kind = "geometry_msgs/msg/TransformStamped"
        return {"transforms": [Fields(kind, one.fields()) for one in self.transforms]}

    @classmethod
    def read(cls, message: Any) -> Transforms:
        """The transforms in a tf2_msgs/msg/TFMessage."""
        return cls(tuple(map(TransformStamped.read, message.transforms)))


def is_static(topic: str) -> bool:
    """Whether the transforms on a topic hold at all times, as tf2 names it."""
    return topic.rstrip("/").endswith("tf_static")
