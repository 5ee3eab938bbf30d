"""Types of messages that a package of ROS 2 has installed, and what reads them."""

from __future__ import annotations

from rclpy.serialization import serialize_message
from rmw_dds_common.msg import NodeEntitiesInfo, ParticipantEntitiesInfo

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
