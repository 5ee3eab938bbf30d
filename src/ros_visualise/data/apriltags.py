"""Detections in the messages of AprilTag detectors, which many recordings hold.

Three are supported: apriltag_msgs/ApriltagArrayStamped (Penn's detector, TagSLAM),
apriltag_msgs/AprilTagDetectionArray (apriltag_ros of ROS 2) and apriltag_ros/AprilTagDetectionArray
(apriltag_ros of ROS 1). All go around a tag anticlockwise from its lower left, as we do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_visualise.data import ros_fields as ros
from ros_visualise.data.fields import field_names
from ros_visualise.data.header import Floats
from ros_visualise.data.hypotheses import Hypothesis

_FAMILY_OF_BITS = {4: "tag16h5", 5: "tag25h9", 6: "tag36h11"}  # in a row of the code
_POSE = ros.pose_with_covariance("covariance")
_HALF = 0.5  # of a pixel: AprilTag counts from the corner of the first one


def tag_in(message: Any) -> dict[str, Any] | None:
    """Attributes of a `Detection` for one tag; None if the message is no tag."""
    names = field_names(message.__class__)
    if "border" in names:
        return _of_penn(message)
    if "centre" in names:
        return _of_apriltag(message)
    return _posed(message) if "size" in names else None


def _of_penn(tag: Any) -> dict[str, Any]:
    """Often its ``family`` names the detector; pixels are counted from the centre of the first."""
    is_family = any(map(str.isdigit, tag.family))
    family = tag.family if is_family else _FAMILY_OF_BITS.get(tag.bits, "")
    return _tag(family, tag, tag.center, 0.0)


def _of_apriltag(tag: Any) -> dict[str, Any]:
    return _tag(str(tag.family), tag, tag.centre, _HALF)


def _tag(family: str, tag: Any, center: Any, offset: float) -> dict[str, Any]:
    """The fewer bits were corrected in it, the better the score."""
    family = f"tag{family.lstrip('tagf')}"  # some write tf36h11 or 36h11
    corners_uv = _points(tag.corners).reshape(4, 2) - offset
    score = 1 / (1 + max(int(tag.hamming), 0))
    low, high = corners_uv.min(axis=0), corners_uv.max(axis=0)
    return {
        "center_uv": (low + high) / 2,
        "size_uv": high - low,
        "hypotheses": (Hypothesis(f"{family}_{tag.id}", score, number=int(tag.id)),),
        "id": str(tag.id),
        "corners_uv": corners_uv,
        "point_uv": _points([center])[0] - offset,
    }


def _points(several: Sequence[Any]) -> Floats:
    """Pixels, which older definitions have as numbers one after the other."""
    plain = [(one.x, one.y) if hasattr(one, "x") else one for one in several]
    return np.array(plain, np.float64)


def _posed(tag: Any) -> dict[str, Any]:
    """A tag, or a bundle of several, with a pose alone: no pixels, and no family."""
    name = "_".join(str(one) for one in tag.id)
    number = int(tag.id[0]) if len(tag.id) == 1 else -1
    pose = _POSE.attributes_of(tag.pose.pose)
    nowhere = np.full(2, np.nan)
    return {
        "center_uv": nowhere,
        "size_uv": nowhere,
        "hypotheses": (Hypothesis(f"tag_{name}", 1.0, number=number, **pose),),
        "id": name,
    }
