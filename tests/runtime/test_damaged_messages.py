"""What of a recording cannot be decoded: it is said with its topic, and the rest goes on."""

from ros_visualise.core.params import Parameters
from ros_visualise.graph.pipelines import alone
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded
from ros_visualise.nodes import find
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.runner import NodeRunner

BROKEN = Recorded("sensor_msgs/msg/Image", b"\1\2\3", Definitions("ros1"), 5)


def test_a_node_names_the_topic_of_what_is_damaged(caplog):
    graph = alone(find("fps_control"))
    runner = NodeRunner(graph.nodes[0], Parameters(graph.nodes[0].params))
    assert runner.step(Packet(0, BROKEN, 0, "image")) == {}
    assert runner.report().dropped == {"damaged": 1}
    assert "fps_control: /image_raw: cannot decode 3 bytes as sensor_msgs/msg/Image" in caplog.text


def test_who_looks_on_is_told_the_topic_of_what_is_damaged(caplog):
    runtime = LocalRuntime(alone(find("fps_control")), None)
    subscription = runtime.subscribe("/image_raw")
    runtime.publish("/image_raw", BROKEN)
    assert subscription.take(0) is None
    assert "/image_raw: cannot decode 3 bytes as sensor_msgs/msg/Image" in caplog.text
