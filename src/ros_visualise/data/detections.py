"""Things detected in images and in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.core.message import Message
from ros_visualise.data import ros_fields as ros
from ros_visualise.data.apriltags import tag_in
from ros_visualise.data.cameras import CameraInfo
from ros_visualise.data.fields import Either, Fields, field_names, header, read_header
from ros_visualise.data.header import Floats, Header, keep
from ros_visualise.data.hypotheses import (
    NO_HYPOTHESIS,
    Hypothesis,
    read_hypotheses,
    write_hypotheses,
)
from ros_visualise.data.ros_fields import TabledMessage

A = TypeVar("A", bound="DetectedArray")

_BOX_3D = ros.SubMessage(
    "vision_msgs/msg/BoundingBox3D", center=ros.POSE, size=ros.vector("size_xyz")
)
_NO_PIXELS = {"header": header(Header()), "data": np.zeros(0, np.uint8), "height": 0, "width": 0}
_NO_IMAGE = {**_NO_PIXELS, "encoding": "", "is_bigendian": 0, "step": 0}
_NO_CLOUD = {
    **_NO_PIXELS,
    **{"fields": [], "is_bigendian": False, "point_step": 0, "row_step": 0, "is_dense": True},
}


class Detected:
    """A detected thing; ``id`` is the same for the same thing at other times."""

    hypotheses: tuple[Hypothesis, ...]
    id: str

    def fields(self, found_in: Header) -> dict[str, Any]:
        """Fields of its part of the ROS message, with the header of the array."""
        raise NotImplementedError

    @classmethod
    def read(cls, message: Any) -> Any:
        """The thing in such a part."""
        raise NotImplementedError

    @property
    def label(self) -> str:
        """Class, score and id, as far as known; a tag's class contains its id."""
        score = f"{self.score:.2f}" if self.hypotheses else ""
        said = self.class_id == self.id or self.class_id.endswith(f"_{self.id}")
        number = f"#{self.id}" if self.id and not said else ""
        return " ".join(part for part in (self.class_id, score, number) if part)

    @property
    def class_id(self) -> str:
        """The most likely class; empty without any."""
        return self.best.class_id

    @property
    def score(self) -> float:
        """Score of the most likely class; 0 without any."""
        return self.best.score

    @property
    def best(self) -> Hypothesis:
        """The most likely hypothesis; without any, one of no class and an unknown pose."""
        return max(self.hypotheses, key=lambda one: one.score, default=NO_HYPOTHESIS)


@dataclass(frozen=True, eq=False)
class DetectedArray(Message):
    """All things detected at one time; ``kind`` is the class of each."""

    kind: ClassVar[type[Detected]]
    plotted = False
    renamed = True

    detections: tuple[Any, ...]
    header: Header = Header()

    def fields(self) -> dict[str, Any]:
        part = self.type_name.removesuffix("Array")
        found = [Fields(part, one.fields(self.header)) for one in self.detections]
        return {"header": header(self.header), "detections": found}

    @classmethod
    def read(cls: type[A], message: Any) -> A:
        # some detectors give a header to the detections alone
        name = "detections" if "detections" in field_names(message.__class__) else "apriltags"
        several = getattr(message, name)
        read = read_header(message.header)
        if read == Header() and len(several) and hasattr(several[0], "header"):
            read = read_header(several[0].header)
        return cls(tuple(map(cls.kind.read, several)), read)


@dataclass(frozen=True, eq=False)
class Detection(Detected):
    """A thing in an image, in pixels, whose origin is the centre of the top-left pixel.

    Its box has ``size_uv`` (2,) about ``center_uv`` (2,), rotated by ``theta`` radians from the
    image's x axis to its y axis; NaN if it was recorded without its pixels. ``corners_uv`` (N, 2)
    are its outline, empty if unknown; those of a tag go anticlockwise from its lower left. ``id``
    is the same for the same thing in other images, empty if unknown. ``point_uv`` (2,) is its
    reference point, None if unknown: the centre of a pad or a tag, the foot of a post; its
    covariance (2, 2) is in square pixels. ``side_m`` is the side of a tag's square in metres, as
    set in its detector; ``corners_covariance`` (8, 8), in square pixels, is that of u and v of its
    first corner, of its second, and so on. Covariances and the side are zero if unknown.
    """

    center_uv: Floats
    size_uv: Floats
    theta: float = 0.0
    hypotheses: tuple[Hypothesis, ...] = ()
    id: str = ""
    corners_uv: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    point_uv: Floats | None = None
    point_covariance: Floats = field(default_factory=lambda: np.zeros((2, 2)))
    side_m: float = 0.0
    corners_covariance: Floats = field(default_factory=lambda: np.zeros((8, 8)))

    def __post_init__(self) -> None:
        keep(self, center_uv=(2,), size_uv=(2,), corners_uv=(-1, 2))
        keep(self, point_covariance=(2, 2), corners_covariance=(8, 8))
        if self.point_uv is not None:
            keep(self, point_uv=(2,))

    @classmethod
    def of_corners(
        cls, corners_uv: npt.ArrayLike, hypotheses: Sequence[Hypothesis] = (), id: str = ""
    ) -> Detection:
        """A thing of this outline (N, 2), N > 2, and the smallest box around it."""
        corners = np.asarray(corners_uv, np.float64)
        center, size, degrees = cv2.minAreaRect(corners.astype(np.float32))
        theta = float(np.deg2rad(degrees))
        return cls(np.array(center), np.array(size), theta, tuple(hypotheses), id, corners)

    def identified(self, id: str) -> Detection:
        """The same thing with another id."""
        made = object.__new__(type(self))  # its arrays are checked already
        vars(made).update(vars(self), id=id)
        return made

    @property
    def outline_uv(self) -> Floats:
        """Its corners where they are known, else those of its box: (N, 2)."""
        if len(self.corners_uv):
            return self.corners_uv
        c, s = np.cos(self.theta), np.sin(self.theta)
        half = self.size_uv / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        corners: Floats = self.center_uv + half @ np.array([[c, s], [-s, c]])
        return corners

    def fields(self, found_in: Header) -> dict[str, Any]:
        x, y = self.center_uv.tolist()
        flat = Fields("geometry_msgs/msg/Pose2D", {"x": x, "y": y, "theta": self.theta})
        position = Fields("vision_msgs/msg/Point2D", {"x": x, "y": y})
        center = Fields("vision_msgs/msg/Pose2D", {"position": position, "theta": self.theta})
        size = dict(zip(("size_x", "size_y"), self.size_uv.tolist(), strict=True))
        box = Fields("vision_msgs/msg/BoundingBox2D", {"center": Either(center, flat), **size})
        return {
            "header": header(found_in),
            "results": write_hypotheses(self.hypotheses),
            "bbox": box,
            "id": self.id,
            "source_img": Fields("sensor_msgs/msg/Image", _NO_IMAGE),
        }

    @classmethod
    def read(cls, message: Any) -> Detection:
        tag = tag_in(message)
        if tag is not None:
            return cls(**tag)
        box = message.bbox
        # before ROS 2 Humble the centre was a geometry_msgs/Pose2D
        center = getattr(box.center, "position", box.center)
        return cls(
            np.array([center.x, center.y], np.float64),
            np.array([box.size_x, box.size_y], np.float64),
            float(box.center.theta),
            read_hypotheses(message.results),
            str(getattr(message, "id", "")),
        )


@dataclass(frozen=True, eq=False)
class Detections(DetectedArray):
    """All things detected in one image, whose header it has.

    ``camera_info`` is the image's calibration and ``size`` its width and height, None if unknown.
    ROS messages lack these, ``corners_uv``, ``point_uv``, ``side_m`` and the covariances; in ROS 1
    a class is a number, and things have no ``id``.
    """

    type_name = "vision_msgs/msg/Detection2DArray"
    also_read = (
        "apriltag_msgs/msg/ApriltagArrayStamped",
        "apriltag_msgs/msg/AprilTagDetectionArray",
        "apriltag_ros/msg/AprilTagDetectionArray",
    )
    kind = Detection

    detections: tuple[Detection, ...]
    camera_info: CameraInfo | None = None
    size: tuple[int, int] | None = None

    @property
    def boxes_uv(self) -> Floats:
        """Upright boxes around them, (N, 4): centre, width and height; NaN if unknown."""
        several = self.detections
        parts = [part for one in several for part in (one.center_uv, one.size_uv)]
        boxes = np.array(parts).reshape(-1, 4)
        for row, one in enumerate(several):
            if one.theta or len(one.corners_uv):
                low, high = one.outline_uv.min(axis=0), one.outline_uv.max(axis=0)
                boxes[row] = *(low + high) / 2, *(high - low)
        return boxes


@dataclass(frozen=True, eq=False)
class Detection3D(Detected):
    """A thing in space: a box of ``size_xyz`` (3,) metres about a pose in the message's frame."""

    position_xyz: Floats
    quat_xyzw: Floats
    size_xyz: Floats
    hypotheses: tuple[Hypothesis, ...] = ()
    id: str = ""

    def __post_init__(self) -> None:
        keep(self, position_xyz=(3,), quat_xyzw=(4,), size_xyz=(3,))

    def fields(self, found_in: Header) -> dict[str, Any]:
        return {
            "header": header(found_in),
            "results": write_hypotheses(self.hypotheses),
            "bbox": _BOX_3D.write(self),
            "id": self.id,
            "source_cloud": Fields("sensor_msgs/msg/PointCloud2", _NO_CLOUD),
        }

    @classmethod
    def read(cls, message: Any) -> Detection3D:
        return cls(
            hypotheses=read_hypotheses(message.results),
            id=str(getattr(message, "id", "")),
            **_BOX_3D.attributes_of(message.bbox),
        )


@dataclass(frozen=True, eq=False)
class Detections3D(DetectedArray):
    """All things detected in space at one time; see `Detections` on ROS 1."""

    type_name = "vision_msgs/msg/Detection3DArray"
    kind = Detection3D

    detections: tuple[Detection3D, ...]


@dataclass(frozen=True)
class VisionInfo(TabledMessage):
    """The detector of a topic, as vision_msgs/VisionInfo; latched.

    ``method`` names the detector. ``database_location`` is the location of the names of its
    classes: by default a file that lists them in the order of `Hypothesis.number`.
    ``database_version`` counts the changes of that list.
    """

    type_name = "vision_msgs/msg/VisionInfo"
    plotted = False
    ros_fields = ros.table(method=str, database_location=str, database_version=int)

    method: str
    database_location: str = ""
    database_version: int = 0
    header: Header = Header()
