"""QoS profiles of a topic's publishers, as recordings of ROS 2 tell them: a YAML list."""

from __future__ import annotations

from rosbags.convert.converter import LATCH
from rosbags.interfaces import QosDurability, QosHistory, QosReliability
from rosbags.rosbag2.metadata import dump_qos_v8, parse_qos

from ros_visualise.core.yaml_files import BadYaml, parse_yaml
from ros_visualise.messages.qos import VOLATILE, QoS
from ros_visualise.messages.recorded import TopicType


def offered_qos(topic: TopicType) -> str:
    """As its recording has it, else what `TopicType.qos` says; empty where that is ROS's default.

    By this ``ros2 bag play`` offers a latched topic as it was.
    """
    return topic.offered_qos or profile(topic.qos)


def profile(qos: QoS) -> str:
    """Of one publisher; empty for ROS's default."""
    if qos == VOLATILE:
        return ""
    found = LATCH[0]._replace(
        history=QosHistory.KEEP_LAST,
        depth=qos.depth,
        reliability=QosReliability.RELIABLE if qos.reliable else QosReliability.BEST_EFFORT,
        durability=QosDurability.TRANSIENT_LOCAL if qos.transient_local else QosDurability.VOLATILE,
    )
    return dump_qos_v8([found])


def in_numbers(profiles: str) -> str:
    """The same with numbers for words, as ``metadata.yaml`` has it; empty where it is damaged."""
    try:
        return dump_qos_v8(parse_qos(parse_yaml(profiles.encode())))
    except (BadYaml, LookupError, TypeError, ValueError, AttributeError):
        return ""
