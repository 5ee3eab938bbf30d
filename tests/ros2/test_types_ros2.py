"""Types of messages that a package of ROS 2 has installed, and what reads them."""

from __future__ import annotations

from importlib.util import find_spec

import pytest
from rclpy.serialization import deserialize_message, serialize_message
from rmw_dds_common.msg import NodeEntitiesInfo, ParticipantEntitiesInfo
from sample_messages import sample

from ros_visualise.core.message import Message, topic_kinds
from ros_visualise.messages import from_message, to_message
from ros_visualise.runtime.ros2.types import DEFINITIONS, message_class


def test_a_type_that_the_library_does_not_know_is_read_as_its_package_defines_it():
    name = "rmw_dds_common/msg/ParticipantEntitiesInfo"
    assert message_class(name) is ParticipantEntitiesInfo
    sent = ParticipantEntitiesInfo(
        node_entities_info_seq=[NodeEntitiesInfo(node_namespace="/uav1", node_name="filters")]
    )
    read = DEFINITIONS.read(name, serialize_message(sent))
    [node] = read.node_entities_info_seq
    assert (node.node_namespace, node.node_name) == ("/uav1", "filters")


@pytest.mark.parametrize("kind", sorted(set(topic_kinds()), key=lambda kind: kind.type_name))
def test_rclpy_reads_and_writes_the_same_bytes(kind: type[Message]):
    name = kind.type_name
    if find_spec(name.partition("/")[0]) is None:
        pytest.skip(f"not installed: {name}")
    ours = written(sample(kind))
    theirs = serialize_message(deserialize_message(ours, message_class(name)))
    assert theirs == ours
    assert written(from_message(DEFINITIONS.read(name, theirs), kind)) == ours


def written(data: Message) -> bytes:
    return bytes(DEFINITIONS.write(data.type_name, to_message(data, DEFINITIONS.types)))
