"""A node of two inputs that draws in 3D: what is nearest, red where the robot would soon be there.

ros-visualise sim husky --mission square --node examples/04_nearest_obstacle.py:nearest
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from ros_visualise.core.synchronizer import Latest
from ros_visualise.data import Header, Marker, MarkerArray, MarkerType, Odometry, PointCloud
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes import node, param


@dataclass(frozen=True)
class NearestParams:
    clearance: float = param(
        0.2, "metres over the robot's base; lower points do not count", min=-1, max=2
    )
    soon: float = param(3.0, "seconds of driving on to what is drawn in red", min=0, max=60)


@node(
    "nearest",
    params=NearestParams,
    inputs={"points": PointCloud, "odom": Odometry},
    outputs={"markers": MarkerArray},
    sync=Latest("points"),  # every scan, with the newest odometry that came before it
    frames=True,
)
def nearest(
    points: PointCloud, odom: Odometry, params: NearestParams, frames: FrameTree
) -> MarkerArray | None:
    """Draws the nearest obstacle, and a line to it."""
    stamp_ns, base = points.header.stamp_ns, odom.child_frame_id
    T_base_lidar = frames.lookup(base, points.header.frame_id, stamp_ns)
    xyz = points.xyz @ T_base_lidar[:3, :3].T + T_base_lidar[:3, 3]
    xyz = xyz[xyz[:, 2] > params.clearance]  # this leaves out NaN, too
    if not len(xyz):
        return None
    found = xyz[np.argmin(np.linalg.norm(xyz, axis=1))]
    distance = float(np.linalg.norm(found))
    is_soon = odom.linear_xyz @ found / distance * params.soon > distance
    draw = partial(
        Marker, header=Header(stamp_ns, base), color_rgba=np.array([1, not is_soon, 0, 1])
    )
    line = np.array([np.zeros(3), found])
    return MarkerArray(
        (
            draw(MarkerType.SPHERE, found, scale_xyz=np.full(3, 0.3)),
            draw(MarkerType.LINE_STRIP, points_xyz=line, scale_xyz=np.full(3, 0.03), id=1),
        )
    )
