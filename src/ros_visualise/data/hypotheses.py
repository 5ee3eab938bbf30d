"""What a detected thing may be <-> vision_msgs, whose versions differ in it."""

from __future__ import annotations

import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ros_visualise.data.fields import Fields, field_names
from ros_visualise.data.header import Floats, keep
from ros_visualise.data.vectors import pose_fields, xyz, xyzw

_LEVEL = np.array([0.0, 0, 0, 1])


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """What a thing may be, and where in space it is then.

    ``class_id`` names the class; ``score`` goes from 0 to 1. The pose, ``position_xyz`` (3,) in
    metres and ``quat_xyzw`` (4,), is in the frame of the message; its ``covariance`` is 6x6, of
    x, y, z and the rotations about them, and all zero where nobody knows. ``number`` is the place
    of the class in the detector's list, for a tag its id; -1 where nobody knows. It travels in ROS
    1 alone, which has no names of classes.
    """

    class_id: str
    score: float
    position_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    quat_xyzw: Floats = field(default_factory=lambda: _LEVEL)
    covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    number: int = -1

    def __post_init__(self) -> None:
        keep(self, position_xyz=(3,), quat_xyzw=(4,), covariance=(6, 6))


class _HypothesisFields(dict[str, Any]):
    """Gives the number of the class when asked: only ROS 1 does, which has no names of classes."""

    def __missing__(self, name: str) -> Any:
        if name != "id":
            raise KeyError(name)
        if self["number"] >= 0:
            return self["number"]
        class_id = self["hypothesis"].values["class_id"]
        try:
            return int(class_id)
        except ValueError:
            short = reprlib.repr(class_id)
            raise ValueError(
                f"class {short}: in vision_msgs of ROS 1 classes are numbers; give its number"
            ) from None


def write_hypotheses(several: Sequence[Hypothesis]) -> list[Fields]:
    """For the results of a detection."""
    return [_write_hypothesis(one) for one in several]


def _write_hypothesis(one: Hypothesis) -> Fields:
    said = {"class_id": one.class_id, "score": one.score}
    pose = {
        "pose": pose_fields(one.position_xyz, one.quat_xyzw),
        "covariance": one.covariance.ravel(),
    }
    values = _HypothesisFields(
        hypothesis=Fields("vision_msgs/msg/ObjectHypothesis", said),
        score=one.score,
        pose=Fields("geometry_msgs/msg/PoseWithCovariance", pose),
        number=one.number,
    )
    return Fields("vision_msgs/msg/ObjectHypothesisWithPose", values)


def read_hypotheses(results: Any) -> tuple[Hypothesis, ...]:
    """Those in the results of a detection."""
    return tuple(map(_read_hypothesis, results))


def _read_hypothesis(message: Any) -> Hypothesis:
    # before ROS 2 Galactic class and score stood here, and the class was called id
    said = getattr(message, "hypothesis", message)
    name = "class_id" if "class_id" in field_names(said.__class__) else "id"
    class_id, pose = getattr(said, name), message.pose
    return Hypothesis(
        str(class_id),
        float(said.score),
        np.array(xyz(pose.pose.position)),
        np.array(xyzw(pose.pose.orientation)),
        np.array(pose.covariance, np.float64).reshape(6, 6),
        -1 if isinstance(class_id, str) else int(class_id),
    )


NO_HYPOTHESIS = Hypothesis("", 0.0)
"""Of a thing that may be anything."""
