"""The Python API: ``import ros_visualise as rv``, explained in docs/reference/python.md.

Its names keep their meaning within a major version; one that goes works for one release more, with
a FutureWarning that names its successor (`ros_visualise.core.deprecation`).
"""

from ros_visualise.api.nodes import ImageLike, NodeAnswer, NodeFunction, node_function
from ros_visualise.api.pictures import calibrate, detect
from ros_visualise.api.reading import (
    Converted,
    Frame,
    OpenSource,
    Sample,
    SourceTopic,
    convert,
    frames,
    messages,
    open,
)
from ros_visualise.api.running import NodeFailed, pipeline, run
from ros_visualise.api.trajectories import PoseTrajectory, TrajectoryErrors, trajectory
from ros_visualise.core.errors import OpenError, ParameterError, RosVisualiseError, UsageError
from ros_visualise.core.limits import set_max_memory
from ros_visualise.core.message import Message
from ros_visualise.data import CameraInfo, Detection, Header, Image, NavSatFix, Odometry
from ros_visualise.graph import Graph
from ros_visualise.landmarks.calibration.calibrating import CameraCalibration
from ros_visualise.nodes import Approximate, Exact, Latest, node, param

__all__ = [
    "Approximate",
    "CameraCalibration",
    "CameraInfo",
    "Converted",
    "Detection",
    "Exact",
    "Frame",
    "Graph",
    "Header",
    "Image",
    "ImageLike",
    "Latest",
    "Message",
    "NavSatFix",
    "NodeAnswer",
    "NodeFailed",
    "NodeFunction",
    "Odometry",
    "OpenError",
    "OpenSource",
    "ParameterError",
    "PoseTrajectory",
    "RosVisualiseError",
    "Sample",
    "SourceTopic",
    "TrajectoryErrors",
    "UsageError",
    "calibrate",
    "convert",
    "detect",
    "frames",
    "messages",
    "node",
    "node_function",
    "open",
    "param",
    "pipeline",
    "run",
    "set_max_memory",
    "trajectory",
]
