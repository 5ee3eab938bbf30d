"""What detectors find in an image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data.apriltags import tag_in
from ros_visualise.data.cameras import CameraInfo
from ros_visualise.data.fields import Either, Fields, header
from ros_visualise.data.found import Found, FoundArray
from ros_visualise.data.header import Floats, Header, keep
from ros_visualise.data.hypotheses import Hypothesis, read_hypotheses, write_hypotheses


@dataclass(frozen=True, eq=False)
class Detection(Found):
    """A thing in an image, in pixels, whose origin is the centre of the top-left pixel.

    Its box has ``size_uv`` (2,) about ``center_uv`` (2,), turned by ``theta`` radians from the
    image's x axis to its y axis. ``corners_uv`` (N, 2) are its outline where that is known, else
    empty; those of a tag go anticlockwise from its lower left. ``id`` is the same for the same
    thing in other images; empty where nobody knows. ``point_uv`` (2,) is where it stands or what
    it is aimed at: the centre of a pad or a tag, the foot of a post; None where nobody knows. Its
    covariance (2, 2), in square pixels, is zero where nobody knows. ``side_m`` is the side of a
    tag's square in metres, as its detector was told, and ``corners_covariance`` (8, 8), in square
    pixels, that of u and v of its first corner, of its second, and so on; both are zero where
    nobody knows. Of what was recorded without its pixels, the box is NaN.
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
        keep(self, center_uv=(2,), size_uv=(2,), corners_uv=(len(self.corners_uv), 2))
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
        """The fields of a vision_msgs/msg/Detection2D."""
        x, y = self.center_uv.tolist()
        flat = Fields("geometry_msgs/msg/Pose2D", {"x": x, "y": y, "theta": self.theta})
        position = Fields("vision_msgs/msg/Point2D", {"x": x, "y": y})
        center = Fields("vision_msgs/msg/Pose2D", {"position": position, "theta": self.theta})
        size = dict(zip(("size_x", "size_y"), self.size_uv.tolist(), strict=True))
        box = Fields("vision_msgs/msg/BoundingBox2D", {"center": Either(center, flat), **size})
        no_image: dict[str, Any] = dict.fromkeys(("height", "width", "is_bigendian", "step"), 0)
        no_image |= {"header": header(Header()), "encoding": "", "data": np.zeros(0, np.uint8)}
        return {
            "header": header(found_in),
            "results": write_hypotheses(self.hypotheses),
            "bbox": box,
            "id": self.id,
            "source_img": Fields("sensor_msgs/msg/Image", no_image),
        }

    @classmethod
    def read(cls, message: Any) -> Detection:
        """The thing in a vision_msgs/msg/Detection2D, or the tag in a detector's own message."""
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
class Detections(FoundArray):
    """What was found in one image: the header is that of the image.

    ``camera_info`` is the image's calibration, None where nobody knows. In messages of ROS 1 a
    class is a number, and there is no ``id``; none has ``corners_uv``, ``point_uv``,
    ``side_m``, their covariances or a calibration.
    """

    type_name: ClassVar[str] = "vision_msgs/msg/Detection2DArray"
    also_read: ClassVar[tuple[str, ...]] = (
        "apriltag_msgs/msg/ApriltagArrayStamped",
        "apriltag_msgs/msg/AprilTagDetectionArray",
        "apriltag_ros/msg/AprilTagDetectionArray",
    )
    kind: ClassVar[type[Found]] = Detection

    detections: tuple[Detection, ...]
    camera_info: CameraInfo | None = None
