"""A node that looks up frames: how far is the robot from where the map begins?

ros-visualise sim husky --world playpen --mission square --node \\
    examples/10_distance_from_home.py:home
"""

import numpy as np

from ros_visualise.data import Number, Odometry
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes import node


@node("home", inputs={"odom": Odometry}, outputs={"distance": Number}, frames=True)
def home(odom: Odometry, params: object, frames: FrameTree) -> Number:
    """Metres from the origin of the frame map, in the plane; to be plotted."""
    T_map_base = frames.lookup("map", odom.child_frame_id, odom.header.stamp_ns)
    return Number(float(np.linalg.norm(T_map_base[:2, 3])), odom.header)
