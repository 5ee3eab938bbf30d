"""A source of one's own on a ROS graph, with its action as a service."""

from catkin_workspace import PACKAGE
from ros_graph import wait_for
from sensor_msgs.msg import Image


def test_a_source_of_ones_own_and_its_action(ros_master, start, hear):
    heard = hear("/image_raw", Image)
    example = f"{PACKAGE / 'examples' / '05_own_source.py'}:Ball"
    start("node", example, node="ball")
    heard.wait(3)
    answer = ros_master.call("rosservice", "call", "/ball/kick")
    assert "success: True" in answer
    before = len(heard.messages)
    wait_for(lambda: len(heard.messages) > before + 3, "images after the kick")
    assert heard.messages[-1].encoding == "mono8"
