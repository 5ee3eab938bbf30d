"""The images, texts, detections and curves of nodes that are shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ros_visualise.data import Detections, Image, Text
from ros_visualise.graph import Graph, Member, Node
from ros_visualise.messages.recorded import Recorded, TopicType

FIRST_FIELDS: Mapping[str, Sequence[str]] = {
    "Odometry": ("pose.pose.position.x", "pose.pose.position.y"),
    "PoseStamped": ("pose.position.x", "pose.position.y"),
    "PoseWithCovarianceStamped": ("pose.pose.position.x", "pose.pose.position.y"),
    "Imu": ("angular_velocity.x", "angular_velocity.y", "angular_velocity.z"),
    "NavSatFix": ("altitude",),
    "BatteryState": ("voltage",),
    "Twist": ("linear.x", "angular.z"),
    "TwistStamped": ("twist.linear.x", "twist.angular.z"),
}
"""Numbers that people look at first: last part of a type -> fields, the first types first."""
Pane = Mapping[str, Any]
"""A pane of a plot, as it is kept in a page's address."""
_MOST_PANES, _MOST_TOPICS = 2, 3
_COMMANDS = {"Twist", "TwistStamped"}
_ANGLES = {"theta", "yaw", "heading"}
_ASIDE = ("rosgraph_msgs/", "rcl_interfaces/")


def images_of(node: Member) -> list[str]:
    """The topics on which a node publishes images."""
    return [topic for port, topic in node.outputs.items() if node.type.outputs[port] is Image]


def texts_of(node: Member) -> list[str]:
    """The topics of a node's texts that a person reads; those of sources are for machines."""
    if not isinstance(node, Node):
        return []
    texts = [topic for port, topic in node.outputs.items() if node.type.outputs[port] is Text]
    return [topic for topic in texts if not is_robot(topic)]


def is_robot(topic: str) -> bool:
    """True if the texts on a topic describe a robot in URDF, by its name in ROS."""
    return topic.rpartition("/")[2] == "robot_description"


def first_shown(graph: Graph, node: Member) -> str | None:
    """The topic to show first: one that another node uses, else the first; None without any."""
    taken = {topic for other in graph.members for topic in other.inputs.values()}
    images = images_of(node)
    return next((topic for topic in images if topic in taken), next(iter(images), None))


def first_panes(graph: Graph) -> list[Pane]:
    """The first panes of a plot; empty without numbers.

    Each has the usual numbers of one type of message, or a place of an unusual one, y over x;
    without any of these, the first numbers of other messages.
    """
    by_type: dict[str, list[str]] = {}
    for topic, spec in graph.topics.items():
        by_type.setdefault(spec.ros.name.rpartition("/")[2], []).append(topic)

    def pane(name: str) -> Pane:
        topics, fields = by_type[name][:_MOST_TOPICS], FIRST_FIELDS[name]
        return {"curves": [f"{topic}:{field}" for topic in topics for field in fields]}

    usual = [name for name in FIRST_FIELDS if name in by_type]
    own = [(topic, _own_numbers(spec.ros)) for topic, spec in graph.topics.items()]
    places: list[Pane] = [
        {"kind": "xy", "x": f"{topic}:x", "curves": [f"{topic}:y"]}
        for topic, paths in own
        if {"x", "y"} <= {*paths} and not _ANGLES.isdisjoint(paths)
    ]
    others: list[Pane] = [
        {"curves": [f"{topic}:{path}" for path in paths[:_MOST_TOPICS]]}
        for topic, paths in own
        if paths
    ]
    measured = [pane(name) for name in usual if name not in _COMMANDS]
    commanded = [pane(name) for name in usual if name in _COMMANDS]
    return (measured + places + commanded or others)[:_MOST_PANES]


def _own_numbers(ros: TopicType) -> list[str]:
    """Paths of the numbers of a type that only its recording defines."""
    if ros.definitions is None or ros.data_class is not Recorded or ros.name.startswith(_ASIDE):
        return []
    return list(ros.definitions.numbers(ros.name))


def detections_of(graph: Graph, image: str) -> list[str]:
    """The topics with detections in the images of a topic.

    They come from a node that takes these images. Those of a node without images as input, such as
    a recording, may belong to any original images.
    """
    is_original = all(
        image not in one.outputs.values() or not _taken_by(one) for one in graph.members
    )
    found = [topic for topic, kind in graph.inputs.items() if kind is Detections and is_original]
    for member in graph.members:
        taken = _taken_by(member)
        if image in taken or (is_original and not taken):
            found += [name for name, topic in member.topics.items() if topic.type is Detections]
    return found


def _taken_by(member: Member) -> list[str]:
    """The topics of images that a node takes."""
    return [topic for port, topic in member.inputs.items() if member.type.inputs[port] is Image]


def robot_status(graph: Graph) -> tuple[Member | None, str | None]:
    """The robot with a status, and the topic of that; None without one."""
    for member in graph.members:
        if member.outputs.get("status") and member.type.outputs["status"] is Text:
            return member, member.outputs["status"]
    return None, None
