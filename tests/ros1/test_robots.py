"""Two simulated robots on one graph: each in its namespace, in one tree of frames, by one clock."""

import signal
import subprocess

import pytest
import rospy
from nav_msgs.msg import Odometry, Path
from ros_graph import end, wait_for
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from ros_visualise.runtime.remote.graph_snapshot import snapshot
from ros_visualise.runtime.ros1.transport import list_graph

ROBOTS = ("uav1", "uav2")
ARGUMENTS = ("rviz:=false", "view:=none", "rate:=0.25", "world:=plane")


@pytest.fixture
def robots(workspace):
    launched = subprocess.Popen(
        ["roslaunch", "ros_visualise", "main_robots.launch", *ARGUMENTS],
        env=workspace.environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    yield
    launched.send_signal(signal.SIGINT)
    print(end(launched))  # which is shown where the test fails
    rospy.delete_param("/use_sim_time")


def test_two_robots_share_a_graph(robots, ros_master, hear):
    clock, tf, static = hear("/clock", Clock), hear("/tf", TFMessage), hear("/tf_static", TFMessage)
    paths = {robot: hear(f"/{robot}/path", Path) for robot in ROBOTS}
    odoms = {robot: hear(f"/{robot}/odom", Odometry) for robot in ROBOTS}
    for heard in (*paths.values(), *odoms.values()):
        heard.wait(3)
    first_s = time_s(clock)
    wait_for(lambda: time_s(clock) > first_s + 1, "a second of simulated time")
    times = [message.clock for message in clock.messages]
    assert times == sorted(times)
    of_robots = [one for one in publishers_of(ros_master, "/clock") if one.startswith("/uav")]
    assert len(of_robots) == 1
    assert not publishers_of(ros_master, "/uav1/tf")
    parents = parents_in(tf) | parents_in(static)
    for robot in ROBOTS:
        assert paths[robot].messages[-1].header.frame_id == f"{robot}/odom"
        assert parents[f"{robot}/base_link"] == f"{robot}/odom"
        assert parents[f"{robot}/odom"] == "map"
        # by a clock of its own a robot would be three seconds ahead
        assert odoms[robot].messages[-1].header.stamp.to_sec() < time_s(clock) + 1
        links = rospy.get_param(f"/{robot}/robot_description").split('link name="')[1:]
        assert links
        assert all(link.startswith(f"{robot}/") for link in links)


def test_a_page_shows_the_nodes_of_its_namespace():
    nodes = ["/uav1/filters", "/uav2/filters", "/map_server", "/uav1/arm/camera", "/uav1/viewer"]
    published = [(f"{node}/images", [node]) for node in nodes]
    types = [(topic, "sensor_msgs/Image") for topic, _ in published]

    def seen_by(own):
        return {node.path for node in snapshot(list_graph(published, [], types), own).nodes}

    assert seen_by("/uav1/viewer") == {"/uav1/filters", "/map_server", "/uav1/arm/camera"}
    assert seen_by("/viewer") == set(nodes)


def time_s(clock):
    return clock.wait()[-1].clock.to_sec()


def parents_in(heard):
    every = [one for message in heard.messages for one in message.transforms]
    return {one.child_frame_id: one.header.frame_id for one in every}


def publishers_of(master, topic):
    publishers, _, _ = master.proxy().getSystemState("/tests")[2]
    return dict(publishers).get(topic, [])
