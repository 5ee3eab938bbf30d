"""Two simulated robots on one graph: each in its namespace, in one tree of frames, by one clock."""

import signal

import pytest
import rospy
from nav_msgs.msg import Odometry, Path
from ros_graph import end, wait_for
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

ROBOTS = ("uav1", "uav2")


@pytest.fixture
def robots(workspace):
    launched = workspace.run_launch_file("main_robots.launch", "rviz:=false", "view:=none")
    yield
    launched.send_signal(signal.SIGINT)
    end(launched)
    rospy.delete_param("/use_sim_time")


def test_two_robots_share_a_graph(robots, ros_master, hear):
    clock, tf, static = hear("/clock", Clock), hear("/tf", TFMessage), hear("/tf_static", TFMessage)
    paths = {robot: hear(f"/{robot}/path", Path) for robot in ROBOTS}
    odoms = {robot: hear(f"/{robot}/odom", Odometry) for robot in ROBOTS}
    for heard in (*paths.values(), *odoms.values()):
        heard.wait(3)
    assert len(publishers_of(ros_master, "/clock")) == 1
    times = [message.clock for message in clock.wait(50)]
    assert times == sorted(times)
    parents = parents_in(tf) | parents_in(static)
    assert not any(name.startswith("/") for name in publishers_of(ros_master, "/uav1/tf"))
    for robot in ROBOTS:
        assert paths[robot].messages[-1].header.frame_id == f"{robot}/odom"
        assert parents[f"{robot}/base_link"] == f"{robot}/odom"
        assert parents[f"{robot}/odom"] == "map"
        stamp, now = odoms[robot].messages[-1].header.stamp, clock.messages[-1].clock
        assert abs((stamp - now).to_sec()) < 30  # of 56 years, where it is a clock of its own
        links = set(rospy.get_param(f"/{robot}/robot_description").split('link name="')[1:])
        assert {link.partition('"')[0] for link in links} <= {f"{robot}/{n}" for n in NAMES}


def parents_in(heard):
    every = [one for message in heard.messages for one in message.transforms]
    return {one.child_frame_id: one.header.frame_id for one in every}


def publishers_of(master, topic):
    publishers, _, _ = master.proxy().getSystemState("/tests")[2]
    return dict(publishers).get(topic, [])
