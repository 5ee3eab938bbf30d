"""Hypotheses on what a detected thing is <-> vision_msgs, whose versions differ in it."""

from __future__ import annotations

import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ros_visualise.data import ros_fields as ros
from ros_visualise.data.fields import Fields, field_names
from ros_visualise.data.header import Floats, keep

_LEVEL = np.array([0.0, 0, 0, 1])
_POSE = ros.pose_with_covariance("covariance")


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A possible class of a thing, and its pose.

    ``class_id`` names the class; ``score`` goes from 0 to 1. The pose, ``position_xyz`` (3,) in
    metres and ``quat_xyzw`` (4,), is in the frame of the message; its ``covariance`` is 6x6, of
    x, y, z and the rotations about them, all zero if unknown. ``number`` is the index of the class
    in the detector's list, for a tag its id; -1 if unknown. Only ROS 1 transmits it, which has no
    names of classes.
    """

    class_id: str
    score: float
    position_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    quat_xyzw: Floats = field(default_factory=lambda: _LEVEL)
    covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    number: int = -1

    def __post_init__(self) -> None:
        keep(self, position_xyz=(3,), quat_xyzw=(4,), covariance=(6, 6))


NO_HYPOTHESIS = Hypothesis("", 0.0)
"""A thing that may be anything."""


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
                f"class {short}: in ROS 1, vision_msgs stores classes as numbers; give its number"
            ) from None


def write_hypotheses(several: Sequence[Hypothesis]) -> list[Fields]:
    """The results of a detection."""
    return list(map(_write_hypothesis, several))


def read_hypotheses(results: Any) -> tuple[Hypothesis, ...]:
    """The hypotheses in the results of a detection."""
    return tuple(map(_read_hypothesis, results))


def _write_hypothesis(one: Hypothesis) -> Fields:
    said = {"class_id": one.class_id, "score": one.score}
    values = _HypothesisFields(
        hypothesis=Fields("vision_msgs/msg/ObjectHypothesis", said),
        score=one.score,
        pose=_POSE.write(one),
        number=one.number,
    )
    return Fields("vision_msgs/msg/ObjectHypothesisWithPose", values)


def _read_hypothesis(message: Any) -> Hypothesis:
    # before ROS 2 Galactic class and score were fields of this message, and the class was an id
    said = getattr(message, "hypothesis", message)
    name = "class_id" if "class_id" in field_names(said.__class__) else "id"
    class_id = getattr(said, name)
    return Hypothesis(
        str(class_id),
        float(said.score),
        number=-1 if isinstance(class_id, str) else int(class_id),
        **_POSE.attributes_of(message.pose),
    )
