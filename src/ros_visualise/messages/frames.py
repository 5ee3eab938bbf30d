"""Transforms between frames <-> messages of geometry_msgs and tf2_msgs."""

from __future__ import annotations

from typing import Any

import numpy as np

from ros_visualise.data import Transforms, TransformStamped
from ros_visualise.messages.build import Fields, header, read_header
from ros_visualise.messages.poses import named, xyz, xyzw


def write_transform(transform: TransformStamped) -> dict[str, Any]:
    """The fields of a geometry_msgs/msg/TransformStamped."""
    values = {
        "translation": named("geometry_msgs/msg/Vector3", transform.translation_xyz),
        "rotation": named("geometry_msgs/msg/Quaternion", transform.quat_xyzw),
    }
    return {
        "header": header(transform.header),
        "child_frame_id": transform.child_frame_id,
        "transform": Fields("geometry_msgs/msg/Transform", values),
    }


def read_transform(message: Any) -> TransformStamped:
    """The transform in a geometry_msgs/msg/TransformStamped."""
    return TransformStamped(
        child_frame_id=str(message.child_frame_id),
        translation_xyz=np.array(xyz(message.transform.translation)),
        quat_xyzw=np.array(xyzw(message.transform.rotation)),
        header=read_header(message.header),
    )


def write_transforms(several: Transforms) -> dict[str, Any]:
    """The fields of a tf2_msgs/msg/TFMessage."""
    kind = "geometry_msgs/msg/TransformStamped"
    return {"transforms": [Fields(kind, write_transform(one)) for one in several.transforms]}


def read_transforms(message: Any) -> Transforms:
    """The transforms in a tf2_msgs/msg/TFMessage."""
    return Transforms(tuple(map(read_transform, message.transforms)))
