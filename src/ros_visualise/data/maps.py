"""Maps of the ground, and outlines on it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.message import Message
from ros_visualise.data import ros_fields as ros
from ros_visualise.data.fields import Fields, header, read_header, read_time, time
from ros_visualise.data.header import Floats, Header, keep
from ros_visualise.data.ros_fields import TabledMessage


@dataclass(frozen=True, eq=False)
class OccupancyGrid(Message):
    """Occupancy probability, or cost, of the cells of a grid.

    ``cells`` (height, width) int8: 0 is free, 100 occupied, -1 unknown; squares of ``resolution``
    metres. Rows go along the y axis of the grid's own frame, columns along x; its origin, the outer
    corner of ``cells[0, 0]``, is at ``position_xyz`` (3,) metres and ``quat_xyzw`` (4,) in the
    frame of the header. ``loaded_ns`` is the time of loading, nanoseconds.
    """

    type_name = "nav_msgs/msg/OccupancyGrid"
    plotted = False

    cells: npt.NDArray[np.int8]
    resolution: float
    position_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    quat_xyzw: Floats = field(default_factory=lambda: np.array([0.0, 0, 0, 1]))
    loaded_ns: int = 0
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, np.int8, cells=(-1, -1))
        keep(self, position_xyz=(3,), quat_xyzw=(4,))

    def fields(self) -> dict[str, Any]:
        height, width = self.cells.shape
        info = {
            "map_load_time": time(self.loaded_ns),
            "resolution": self.resolution,
            "width": width,
            "height": height,
            "origin": ros.POSE.write(self),
        }
        return {
            "header": header(self.header),
            "info": Fields("nav_msgs/msg/MapMetaData", info),
            "data": np.ascontiguousarray(self.cells).ravel(),
        }

    @classmethod
    def read(cls, message: Any) -> OccupancyGrid:
        info = message.info
        height, width = int(info.height), int(info.width)
        cells = np.asarray(message.data, np.int8)
        if cells.size != height * width:
            raise ValueError(f"a map of {width}x{height} cells, but the message holds {cells.size}")
        return cls(
            cells=cells.reshape(height, width),
            resolution=float(info.resolution),
            loaded_ns=read_time(info.map_load_time),
            header=read_header(message.header),
            **ros.POSE.attributes_of(info.origin),
        )


@dataclass(frozen=True, eq=False)
class PolygonStamped(TabledMessage):
    """Corners (N, 3) of a closed polygon, metres, such as the footprint of a robot."""

    type_name = "geometry_msgs/msg/PolygonStamped"
    plotted = False
    ros_fields = ros.table(
        polygon=ros.SubMessage(
            "geometry_msgs/msg/Polygon",
            points=ros.rows("points_xyz", "geometry_msgs/msg/Point32", dtype=np.float32),
        )
    )

    points_xyz: npt.NDArray[np.float32]
    header: Header = Header()
