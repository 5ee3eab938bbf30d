"""The messages that travel between nodes: frozen dataclasses on numpy arrays.

A message is never changed after it was made, so it passes between threads by reference.

A new kind of message is one file here, found by its place in this folder.
"""

from importlib import import_module
from pkgutil import iter_modules

from ros_visualise.core.message import Message as Message
from ros_visualise.data.cameras import CameraInfo as CameraInfo
from ros_visualise.data.clouds import PointCloud as PointCloud
from ros_visualise.data.detections import Detection as Detection
from ros_visualise.data.detections import Detection3D as Detection3D
from ros_visualise.data.detections import Detections as Detections
from ros_visualise.data.detections import Detections3D as Detections3D
from ros_visualise.data.detections import VisionInfo as VisionInfo
from ros_visualise.data.header import Floats as Floats
from ros_visualise.data.header import Header as Header
from ros_visualise.data.header import Pixels as Pixels
from ros_visualise.data.hypotheses import Hypothesis as Hypothesis
from ros_visualise.data.images import ENCODINGS as ENCODINGS
from ros_visualise.data.images import MEASUREMENTS as MEASUREMENTS
from ros_visualise.data.images import CompressedImage as CompressedImage
from ros_visualise.data.images import Deferred as Deferred
from ros_visualise.data.images import Image as Image
from ros_visualise.data.maps import OccupancyGrid as OccupancyGrid
from ros_visualise.data.maps import PolygonStamped as PolygonStamped
from ros_visualise.data.markers import Marker as Marker
from ros_visualise.data.markers import MarkerAction as MarkerAction
from ros_visualise.data.markers import MarkerArray as MarkerArray
from ros_visualise.data.markers import MarkerType as MarkerType
from ros_visualise.data.poses import Odometry as Odometry
from ros_visualise.data.poses import Path as Path
from ros_visualise.data.poses import PoseArray as PoseArray
from ros_visualise.data.poses import PoseStamped as PoseStamped
from ros_visualise.data.poses import PoseWithCovarianceStamped as PoseWithCovarianceStamped
from ros_visualise.data.poses import Transforms as Transforms
from ros_visualise.data.poses import TransformStamped as TransformStamped
from ros_visualise.data.poses import Twist as Twist
from ros_visualise.data.poses import TwistStamped as TwistStamped
from ros_visualise.data.poses import TwistWithCovarianceStamped as TwistWithCovarianceStamped
from ros_visualise.data.reports import DiagnosticArray as DiagnosticArray
from ros_visualise.data.reports import DiagnosticStatus as DiagnosticStatus
from ros_visualise.data.reports import Level as Level
from ros_visualise.data.reports import ParameterEvent as ParameterEvent
from ros_visualise.data.sensors import FluidPressure as FluidPressure
from ros_visualise.data.sensors import Imu as Imu
from ros_visualise.data.sensors import JointState as JointState
from ros_visualise.data.sensors import LaserScan as LaserScan
from ros_visualise.data.sensors import MagneticField as MagneticField
from ros_visualise.data.sensors import NavSatFix as NavSatFix
from ros_visualise.data.sensors import Range as Range
from ros_visualise.data.sensors import TimeReference as TimeReference
from ros_visualise.data.values import Number as Number
from ros_visualise.data.values import Octets as Octets
from ros_visualise.data.values import Text as Text

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")  # which makes its messages known
