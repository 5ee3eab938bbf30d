"""Markers: shapes to draw in 3D, as rviz has them."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from ros_visualise.data import ros_fields as ros
from ros_visualise.data.fields import Fields, header
from ros_visualise.data.header import Floats, Header, read_only
from ros_visualise.data.ros_fields import TabledMessage

Colors = npt.NDArray[np.float32]

_COLOR = "std_msgs/msg/ColorRGBA"
_NO_POINTS, _NO_COLORS = read_only(np.zeros((0, 3))), read_only(np.zeros((0, 4), np.float32))
_NO_IMAGE = {"header": header(Header()), "format": "", "data": np.zeros(0, np.uint8)}
_NO_FILE = {"filename": "", "data": np.zeros(0, np.uint8)}


class MarkerType(IntEnum):
    """Shape of a marker; only ROS 2 has the last one."""

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
    """Action of a marker; adding replaces an existing one."""

    ADD = 0
    DELETE = 2
    DELETEALL = 3


@dataclass(frozen=True, eq=False)
class Marker(TabledMessage):
    """A shape at a pose in the frame of the header.

    ``type`` is one of `MarkerType`, ``action`` one of `MarkerAction`. ``scale_xyz`` (3,) are its
    lengths in metres. ``color_rgba`` (4,) goes from 0 to 1; an alpha of 0 is invisible.
    ``points_xyz`` (N, 3) are in metres in the marker's own frame, and ``colors_rgba`` (N, 4) or
    (0, 4) their colours. ``ns`` and ``id`` identify it on its topic. It expires after
    ``lifetime_ns``, never for 0. ``frame_locked``: it moves with its frame.

    ``mesh_resource`` names a file. Textures and meshes inside the message (ROS 2) are ignored.

    Source: visualization_msgs/Marker; wiki.ros.org/rviz/DisplayTypes/Marker.
    """

    type_name = "visualization_msgs/msg/Marker"
    ros_fields = ros.table(
        ns=str,
        id=int,
        type=int,
        action=int,
        frame_locked=bool,
        pose=ros.POSE,
        scale=ros.vector("scale_xyz"),
        color=ros.numbers("color_rgba", _COLOR, "rgba", np.float32),
        lifetime=ros.lifetime("lifetime_ns"),
        points=ros.rows("points_xyz", "geometry_msgs/msg/Point"),
        colors=ros.rows("colors_rgba", _COLOR, "rgba", np.float32),
        text=str,
        mesh_resource=str,
        mesh_use_embedded_materials=bool,
        texture_resource=ros.Unused(""),
        texture=ros.Unused(Fields("sensor_msgs/msg/CompressedImage", _NO_IMAGE)),
        uv_coordinates=ros.Unused([]),
        mesh_file=ros.Unused(Fields("visualization_msgs/msg/MeshFile", _NO_FILE)),
    )

    type: int
    position_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    quat_xyzw: Floats = field(default_factory=lambda: np.array([0.0, 0, 0, 1]))
    scale_xyz: Floats = field(default_factory=lambda: np.ones(3))
    color_rgba: Colors = field(default_factory=lambda: np.ones(4, np.float32))
    points_xyz: Floats = field(default_factory=lambda: _NO_POINTS)
    colors_rgba: Colors = field(default_factory=lambda: _NO_COLORS)
    text: str = ""
    mesh_resource: str = ""
    mesh_use_embedded_materials: bool = False
    ns: str = ""
    id: int = 0
    action: int = MarkerAction.ADD
    lifetime_ns: int = 0
    frame_locked: bool = False
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class MarkerArray(TabledMessage):
    """Several markers sent at once."""

    type_name = "visualization_msgs/msg/MarkerArray"
    plotted = False
    ros_fields = ros.table(markers=ros.several("markers", Marker))

    markers: tuple[Marker, ...]

    @property
    def header(self) -> Header:
        """Header of the first added marker, as deletions have no frame; else of the first."""
        added = (one for one in self.markers if one.action == MarkerAction.ADD)
        first = next(added, self.markers[0] if self.markers else None)
        return Header() if first is None else first.header
