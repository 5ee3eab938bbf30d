"""Maps and outlines <-> messages of nav_msgs and geometry_msgs."""

from __future__ import annotations

from typing import Any

import numpy as np

from ros_visualise.data import OccupancyGrid, PolygonStamped
from ros_visualise.messages.build import Fields, header, read_header, read_time, time
from ros_visualise.messages.poses import columns, pose_fields, xyz, xyzw


def write_grid(grid: OccupancyGrid) -> dict[str, Any]:
    """The fields of a nav_msgs/msg/OccupancyGrid."""
    height, width = grid.cells.shape
    info = {
        "map_load_time": time(grid.loaded_ns),
        "resolution": grid.resolution,
        "width": width,
        "height": height,
        "origin": pose_fields(grid.position_xyz, grid.quat_xyzw),
    }
    return {
        "header": header(grid.header),
        "info": Fields("nav_msgs/msg/MapMetaData", info),
        "data": np.ascontiguousarray(grid.cells).ravel(),
    }


def read_grid(message: Any) -> OccupancyGrid:
    """The map in a nav_msgs/msg/OccupancyGrid.

    Raises:
        ValueError: it holds more or fewer cells than its size says.
    """
    info = message.info
    height, width = int(info.height), int(info.width)
    cells = np.asarray(message.data, np.int8)
    if cells.size != height * width:
        raise ValueError(f"a map of {width}x{height} cells, but the message holds {cells.size}")
    return OccupancyGrid(
        cells=cells.reshape(height, width),
        resolution=float(info.resolution),
        position_xyz=np.array(xyz(info.origin.position)),
        quat_xyzw=np.array(xyzw(info.origin.orientation)),
        loaded_ns=read_time(info.map_load_time),
        header=read_header(message.header),
    )


def write_polygon(polygon: PolygonStamped) -> dict[str, Any]:
    """The fields of a geometry_msgs/msg/PolygonStamped."""
    points = {"points": columns("geometry_msgs/msg/Point32", polygon.points_xyz)}
    return {
        "header": header(polygon.header),
        "polygon": Fields("geometry_msgs/msg/Polygon", points),
    }


def read_polygon(message: Any) -> PolygonStamped:
    """The corners in a geometry_msgs/msg/PolygonStamped."""
    points = [xyz(point) for point in message.polygon.points]
    return PolygonStamped(np.array(points, np.float32).reshape(-1, 3), read_header(message.header))
