"""What detectors find in space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ros_visualise.data.fields import Fields, header
from ros_visualise.data.header import Floats, Header, keep
from ros_visualise.data.hypotheses import (
    Found,
    Hypothesis,
    read_header_of,
    read_hypotheses,
    write_hypotheses,
)
from ros_visualise.data.message import Message
from ros_visualise.data.vectors import named, pose_fields, xyz, xyzw


@dataclass(frozen=True, eq=False)
class Detection3D(Found):
    """A thing in space: a box of ``size_xyz`` (3,) metres about a pose in the message's frame."""

    position_xyz: Floats
    quat_xyzw: Floats
    size_xyz: Floats
    hypotheses: tuple[Hypothesis, ...] = ()
    id: str = ""

    def __post_init__(self) -> None:
        keep(self, position_xyz=(3,), quat_xyzw=(4,), size_xyz=(3,))


@dataclass(frozen=True, eq=False)
class Detections3D(Message):
    """What was found in space at one time; as with `Detections`, ROS 1 holds less of it."""

    type_name: ClassVar[str] = "vision_msgs/msg/Detection3DArray"
    plotted: ClassVar[bool] = False
    renamed: ClassVar[bool] = True

    detections: tuple[Detection3D, ...]
    header: Header = Header()

    def fields(self) -> dict[str, Any]:
        """The fields of a vision_msgs/msg/Detection3DArray, of ROS 1 and of ROS 2.

        Raises:
            ValueError: it is for ROS 1 and a class is no number.
        """
        kind = "vision_msgs/msg/Detection3D"
        found = [Fields(kind, self._fields_of(one)) for one in self.detections]
        return {"header": header(self.header), "detections": found}

    @classmethod
    def read(cls, message: Any) -> Detections3D:
        """What was found by a vision_msgs/msg/Detection3DArray."""
        found = tuple(map(_read_detection_3d, message.detections))
        return cls(found, read_header_of(message))

    def _fields_of(self, one: Detection3D) -> dict[str, Any]:
        box = {
            "center": pose_fields(one.position_xyz, one.quat_xyzw),
            "size": named("geometry_msgs/msg/Vector3", one.size_xyz),
        }
        no_cloud: dict[str, Any] = dict.fromkeys(("height", "point_step", "row_step", "width"), 0)
        no_cloud |= {"header": header(Header()), "fields": [], "data": np.zeros(0, np.uint8)}
        no_cloud |= {"is_bigendian": False, "is_dense": True}
        return {
            "header": header(self.header),
            "results": write_hypotheses(one.hypotheses),
            "bbox": Fields("vision_msgs/msg/BoundingBox3D", box),
            "id": one.id,
            "source_cloud": Fields("sensor_msgs/msg/PointCloud2", no_cloud),
        }


def _read_detection_3d(message: Any) -> Detection3D:
    center = message.bbox.center
    return Detection3D(
        np.array(xyz(center.position)),
        np.array(xyzw(center.orientation)),
        np.array(xyz(message.bbox.size)),
        read_hypotheses(message.results),
        str(getattr(message, "id", "")),
    )
