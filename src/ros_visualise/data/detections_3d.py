"""What detectors find in space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ros_visualise.data.fields import Fields, header
from ros_visualise.data.found import Found, FoundArray
from ros_visualise.data.header import Floats, Header, keep
from ros_visualise.data.hypotheses import Hypothesis, read_hypotheses, write_hypotheses
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

    def fields(self, found_in: Header) -> dict[str, Any]:
        """The fields of a vision_msgs/msg/Detection3D."""
        box = {
            "center": pose_fields(self.position_xyz, self.quat_xyzw),
            "size": named("geometry_msgs/msg/Vector3", self.size_xyz),
        }
        no_cloud: dict[str, Any] = dict.fromkeys(("height", "point_step", "row_step", "width"), 0)
        no_cloud |= {"header": header(Header()), "fields": [], "data": np.zeros(0, np.uint8)}
        no_cloud |= {"is_bigendian": False, "is_dense": True}
        return {
            "header": header(found_in),
            "results": write_hypotheses(self.hypotheses),
            "bbox": Fields("vision_msgs/msg/BoundingBox3D", box),
            "id": self.id,
            "source_cloud": Fields("sensor_msgs/msg/PointCloud2", no_cloud),
        }

    @classmethod
    def read(cls, message: Any) -> Detection3D:
        """The thing in a vision_msgs/msg/Detection3D."""
        center = message.bbox.center
        return cls(
            np.array(xyz(center.position)),
            np.array(xyzw(center.orientation)),
            np.array(xyz(message.bbox.size)),
            read_hypotheses(message.results),
            str(getattr(message, "id", "")),
        )


@dataclass(frozen=True, eq=False)
class Detections3D(FoundArray):
    """What was found in space at one time; as with `Detections`, ROS 1 holds less of it."""

    type_name: ClassVar[str] = "vision_msgs/msg/Detection3DArray"
    kind: ClassVar[type[Found]] = Detection3D

    detections: tuple[Detection3D, ...]
