"""Points, vectors, quaternions and poses, to and from the fields of messages."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data.fields import Columns, Fields
from ros_visualise.data.header import Floats


def pose_fields(position_xyz: Floats, quat_xyzw: Floats) -> Fields:
    """A pose."""
    values = {
        "position": named("geometry_msgs/msg/Point", position_xyz),
        "orientation": named("geometry_msgs/msg/Quaternion", quat_xyzw),
    }
    return Fields("geometry_msgs/msg/Pose", values)


def named(type_name: str, numbers: Floats) -> Fields:
    """A message of the fields x, y, z and perhaps w."""
    return Fields(type_name, dict(zip("xyzw", numbers.tolist(), strict=False)))


def columns(type_name: str, rows: npt.NDArray[np.floating]) -> Columns:
    """Messages of the fields x, y, z and perhaps w, one for each row."""
    return Columns(type_name, len(rows), dict(zip("xyzw", rows.T.tolist(), strict=False)))


def xyz(message: Any) -> tuple[float, float, float]:
    """The numbers of a point or a vector."""
    return message.x, message.y, message.z


def xyzw(message: Any) -> tuple[float, float, float, float]:
    """The numbers of a quaternion."""
    return message.x, message.y, message.z, message.w
