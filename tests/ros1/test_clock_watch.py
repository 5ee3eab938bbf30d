"""Simulated time that nobody publishes is said; where the launch file starts a clock, it is not."""

import subprocess
import time

import pytest
import rosgraph
import rospy
from ros_graph import end, wait_for
from rosgraph_msgs.msg import Clock, Log
from std_msgs.msg import String

from ros_visualise.data import Text
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder

LAUNCH = """<launch>
  <param name="/use_sim_time" value="true"/>
  <node name="fps_control" pkg="ros_visualise" type="fps_control" output="screen"/>
  <node name="player" pkg="ros_visualise" type="player" output="screen" launch-prefix="{late}">
    <param name="path" type="str" value="{bag}"/>
  </node>
</launch>"""
LATE = "sh -c 'sleep 5; exec &quot;$0&quot; &quot;$@&quot;'"
WORDS = "nothing publishes /clock"
LONGER_THAN_ITS_PATIENCE_S = 4


class Launched:
    """A launch that ends with the test."""

    def __init__(self, environment, *args):
        self.process = subprocess.Popen(
            ["roslaunch", *args],
            env=environment,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        end(self.process)
        rospy.delete_param("/use_sim_time")


def test_a_clock_that_starts_late_is_waited_for(workspace, hear, tmp_path):
    bag = tmp_path / "words.bag"
    with open_recorder(str(bag), {"/words": TopicType("std_msgs/msg/String")}) as recorder:
        for second in range(1, 30):
            recorder.write("/words", Text(str(second)), second * 10**9)
    launch = tmp_path / "late.launch"
    launch.write_text(LAUNCH.format(bag=bag, late=LATE))
    clock, words = hear("/clock", Clock), hear("/words", String)
    with Launched(workspace.environment, str(launch)) as launched:
        clock.wait(3)
        words.wait(1)
        assert WORDS not in end(launched.process)


def test_an_ordinary_start_of_a_simulator_says_nothing(workspace, hear):
    pytest.importorskip("mujoco", reason="pip install 'ros_visualise[sim]' to run this")
    clock = hear("/clock", Clock)
    args = ("ros_visualise", "main_path.launch", "view:=none", "rviz:=false")
    with Launched(workspace.environment, *args) as launched:
        clock.wait(3)
        assert WORDS not in end(launched.process)


def test_a_publisher_of_the_clock_that_has_no_time_yet_is_waited_for(start, hear):
    rospy.set_param("/use_sim_time", True)
    opening = rospy.Publisher("/clock", Clock, queue_size=1)  # of this process, which answers
    log = hear("/rosout", Log)
    try:
        start("filters")
        time.sleep(LONGER_THAN_ITS_PATIENCE_S)
        assert not [line.msg for line in log.messages if WORDS in line.msg]
        opening.unregister()
        wait_for(lambda: [line for line in log.messages if WORDS in line.msg], WORDS)
    finally:
        rospy.delete_param("/use_sim_time")


def test_a_clock_that_is_none_is_said(start, workspace):
    rospy.set_param("/use_sim_time", True)
    rospy.set_param("/roslaunch/uris/gone__1", "http://127.0.0.1:9/")  # as a killed one leaves it
    gone = rosgraph.Master("/gone")  # and a killed simulator
    gone.registerPublisher("/clock", "rosgraph_msgs/Clock", "http://127.0.0.1:9/")
    try:
        node = start("filters")
        line = wait_for(lambda: next((one for one in node.stdout if WORDS in one), ""), WORDS)
        assert "rosparam delete /use_sim_time" in line
    finally:
        rospy.delete_param("/use_sim_time")
        rospy.delete_param("/roslaunch/uris/gone__1")
        gone.unregisterPublisher("/clock", "http://127.0.0.1:9/")
