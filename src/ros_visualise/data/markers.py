"""Markers: shapes to draw in 3D, as rviz has them."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from ros_visualise.core.message import Message
from ros_visualise.data.fields import Columns, Fields, duration, header, read_header, read_time
from ros_visualise.data.header import Floats, Header, keep
from ros_visualise.data.vectors import columns, named, pose_fields, xyz, xyzw

Colors = npt.NDArray[np.float32]


class MarkerType(IntEnum):
    """What a marker is; only ROS 2 has the last one."""

    ARROW = 0
    CUBE = 1
    SPHERE = 2
    CYLINDER = 3
    LINE_STRIP = 4
    LINE_LIST = 5
    CUBE_LIST = 6
    SPHERE_LIST = 7
    POINTS = 8
    TEXT_VIEW_FACING = 9
    MESH_RESOURCE = 10
    TRIANGLE_LIST = 11
    ARROW_STRIP = 12


class MarkerAction(IntEnum):
    """What is done with a marker; one that is there already is replaced."""

    ADD = 0
    DELETE = 2
    DELETEALL = 3


@dataclass(frozen=True, eq=False)
class Marker(Message):
    """A shape at a pose in the frame of the header.

    ``type`` is one of `MarkerType`, ``action`` one of `MarkerAction`. ``scale_xyz`` (3,) are its
    lengths in metres. ``color_rgba`` (4,) goes from 0 to 1; an alpha of 0 cannot be seen.
    ``points_xyz`` (N, 3) are in metres in the marker's own frame, and ``colors_rgba`` (N, 4) or
    (0, 4) are theirs. ``ns`` and ``id`` together name it on its topic. It is there for
    ``lifetime_ns``, 0 for as long as nobody deletes it. ``frame_locked``: it moves with its frame.

    ``mesh_resource`` names a file. Textures and meshes inside the message, as of ROS 2, are left
    behind.

    Source: visualization_msgs/Marker; wiki.ros.org/rviz/DisplayTypes/Marker.
    """

    type_name: ClassVar[str] = "visualization_msgs/msg/Marker"

    type: int
    position_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    quat_xyzw: Floats = field(default_factory=lambda: np.array([0.0, 0, 0, 1]))
    scale_xyz: Floats = field(default_factory=lambda: np.ones(3))
    color_rgba: Colors = field(default_factory=lambda: np.ones(4, np.float32))
    points_xyz: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    colors_rgba: Colors = field(default_factory=lambda: np.zeros((0, 4), np.float32))
    text: str = ""
    mesh_resource: str = ""
    mesh_use_embedded_materials: bool = False
    ns: str = ""
    id: int = 0
    action: int = MarkerAction.ADD
    lifetime_ns: int = 0
    frame_locked: bool = False
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, position_xyz=(3,), quat_xyzw=(4,), scale_xyz=(3,))
        keep(self, points_xyz=(len(self.points_xyz), 3))
        keep(self, np.float32, color_rgba=(4,), colors_rgba=(len(self.colors_rgba), 4))

    def fields(self) -> dict[str, Any]:
        """The fields of a visualization_msgs/msg/Marker."""
        no_image = {"header": header(Header()), "format": "", "data": np.zeros(0, np.uint8)}
        return {
            "header": header(self.header),
            **{name: getattr(self, name) for name in _AS_THEY_ARE},
            "type": int(self.type),
            "action": int(self.action),
            "pose": pose_fields(self.position_xyz, self.quat_xyzw),
            "scale": named("geometry_msgs/msg/Vector3", self.scale_xyz),
            "color": Fields(_COLOR, dict(zip("rgba", self.color_rgba.tolist(), strict=True))),
            "lifetime": duration(self.lifetime_ns),
            "points": columns("geometry_msgs/msg/Point", self.points_xyz),
            "colors": _write_colors(self.colors_rgba),
            "texture_resource": "",
            "texture": Fields("sensor_msgs/msg/CompressedImage", no_image),
            "uv_coordinates": [],
            "mesh_file": Fields(_MESH_FILE, {"filename": "", "data": np.zeros(0, np.uint8)}),
        }

    @classmethod
    def read(cls, message: Any) -> Marker:
        """The marker in a visualization_msgs/msg/Marker."""
        return cls(
            type=int(message.type),
            position_xyz=np.array(xyz(message.pose.position)),
            quat_xyzw=np.array(xyzw(message.pose.orientation)),
            scale_xyz=np.array(xyz(message.scale)),
            color_rgba=np.array(_rgba(message.color), np.float32),
            points_xyz=np.array([xyz(one) for one in message.points], np.float64).reshape(-1, 3),
            colors_rgba=np.array([_rgba(c) for c in message.colors], np.float32).reshape(-1, 4),
            text=str(message.text),
            mesh_resource=str(message.mesh_resource),
            mesh_use_embedded_materials=bool(message.mesh_use_embedded_materials),
            ns=str(message.ns),
            id=int(message.id),
            action=int(message.action),
            lifetime_ns=read_time(message.lifetime),
            frame_locked=bool(message.frame_locked),
            header=read_header(message.header),
        )


@dataclass(frozen=True, eq=False)
class MarkerArray(Message):
    """Several markers that were sent at once."""

    type_name: ClassVar[str] = "visualization_msgs/msg/MarkerArray"
    plotted: ClassVar[bool] = False

    markers: tuple[Marker, ...]

    @property
    def header(self) -> Header:
        """That of the first that is added, as what deletes others is in no frame; else of any."""
        added = (one for one in self.markers if one.action == MarkerAction.ADD)
        first = next(added, self.markers[0] if self.markers else None)
        return Header() if first is None else first.header

    def fields(self) -> dict[str, Any]:
        """The fields of a visualization_msgs/msg/MarkerArray."""
        return {"markers": [Fields(Marker.type_name, one.fields()) for one in self.markers]}

    @classmethod
    def read(cls, message: Any) -> MarkerArray:
        """The markers in a visualization_msgs/msg/MarkerArray."""
        return cls(tuple(map(Marker.read, message.markers)))


_COLOR = "std_msgs/msg/ColorRGBA"
_MESH_FILE = "visualization_msgs/msg/MeshFile"
_AS_THEY_ARE = ("ns", "id", "text", "mesh_resource", "mesh_use_embedded_materials", "frame_locked")


def _rgba(color: Any) -> tuple[float, float, float, float]:
    return color.r, color.g, color.b, color.a


def _write_colors(rgba: Colors) -> Columns:
    return Columns(_COLOR, len(rgba), dict(zip("rgba", rgba.T.tolist(), strict=True)))
