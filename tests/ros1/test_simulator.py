"""Simulated robots on a real graph, as stock ROS sees and drives them."""

import math
import signal
from collections.abc import Iterator
from itertools import pairwise

import pytest
import rospy
import tf2_ros
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from ros_graph import PATIENCE_S, Master, Nodes, wait_for
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, FluidPressure, Image, Imu, MagneticField, NavSatFix
from std_srvs.srv import Trigger

pytest.importorskip("mujoco", reason="pip install 'ros_visualise[sim]' to run this")

ODOM_PERIOD_NS = 20_000_000


@pytest.fixture(scope="module")
def husky(ros_master: Master) -> Iterator[None]:
    """A rover that stands on a plane."""
    nodes = Nodes(ros_master)
    size = ("_camera_width:=64", "_camera_height:=48")
    nodes.start("husky", "_world:=plane", "_lidar:=false", *size)
    yield
    nodes.stop()


def ask(service):
    """What a service answers, once it is there."""
    rospy.wait_for_service(service, PATIENCE_S)
    return rospy.ServiceProxy(service, Trigger)()


def place(heard):
    """Where the last odometry says that the robot is, and how fast it goes."""
    message = heard.wait()[-1]
    position, speed = message.pose.pose.position, message.twist.twist.linear
    return (position.x, position.y, position.z), math.hypot(speed.x, speed.y, speed.z)


def near(heard, goal, distance_m):
    return math.dist(place(heard)[0], goal) < distance_m


def test_it_goes_as_it_is_told(husky, hear):
    truth, odom = hear("/ground_truth/odom", Odometry), hear("/odom", Odometry)
    (x, y, z), _ = place(truth)
    publisher = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
    ahead = Twist()
    ahead.linear.x = 0.5

    def drive():
        publisher.publish(ahead)
        return place(truth)[0][0] > x + 1

    wait_for(drive, "a metre")
    assert ask("/husky/stop").success
    publisher.unregister()
    wait_for(lambda: place(truth)[1] < 0.01, "a stop")
    _, y_now, z_now = place(truth)[0]
    assert (y_now, z_now) == pytest.approx((y, z), abs=0.1)
    gone = place(odom)[0][0]
    assert gone == pytest.approx(place(truth)[0][0], abs=0.2)


def test_its_frames_are_joined(husky, hear):
    truth = hear("/ground_truth/odom", Odometry)
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)
    for frame in ("base_link", "camera_optical", "imu_link", "gps_link", "base_footprint"):
        wait_for(lambda f=frame: buffer.can_transform("map", f, rospy.Time(0)), frame)

    def is_joined():
        there = buffer.lookup_transform("map", "base_link", rospy.Time(0)).transform.translation
        return near(truth, (there.x, there.y, there.z), 0.3)

    wait_for(is_joined, "its frames")  # a robot of another test may end late
    listener.unregister()


def test_a_calibration_is_beside_each_image(husky, hear):
    images, infos = hear("/image_raw", Image), hear("/camera_info", CameraInfo)
    image = images.wait(2)[-1]
    wait_for(
        lambda: [i for i in infos.messages if i.header.stamp == image.header.stamp], "its info"
    )
    info = infos.messages[-1]
    assert (image.width, image.height) == (info.width, info.height) == (64, 48)
    assert image.header.frame_id == info.header.frame_id == "camera_optical"
    width_seen = 2 * math.degrees(math.atan(32 / info.K[0]))
    assert width_seen == pytest.approx(80, abs=0.1)
    assert len(set(image.data)) > 10


def test_its_time_is_that_of_its_messages(husky, hear):
    clock, odom, imu = hear("/clock", Clock), hear("/odom", Odometry), hear("/imu/data", Imu)
    client = Client("husky", timeout=PATIENCE_S)
    for heard in (odom, imu, clock):
        heard.wait(20)
    client.update_configuration({"paused": True})

    def stands():
        return len({message.clock for message in clock.messages[-20:]}) == 1

    def ahead_ns():
        return clock.messages[-1].clock.to_nsec() - odom.messages[-1].header.stamp.to_nsec()

    try:
        wait_for(lambda: stands() and 0 <= ahead_ns() <= ODOM_PERIOD_NS, "time to stand still")
    finally:
        client.update_configuration({"paused": False})
        client.close()
    paused = odom.messages[-1].header.stamp
    wait_for(lambda: odom.messages[-1].header.stamp > paused, "time to go on")
    times = [message.clock.to_nsec() for message in clock.messages]
    assert times == sorted(times)
    for heard, period_ns in ((odom, ODOM_PERIOD_NS), (imu, ODOM_PERIOD_NS // 2)):
        stamps = [message.header.stamp.to_nsec() for message in heard.messages]
        assert all(b > a and (b - a) % period_ns == 0 for a, b in pairwise(stamps))


def test_a_goal_in_another_frame_is_refused(husky, hear):
    truth = hear("/ground_truth/odom", Odometry)
    before, _ = place(truth)
    publisher = rospy.Publisher("/goal", PoseStamped, queue_size=1)
    wait_for(publisher.get_num_connections, "the rover to listen")
    goal = PoseStamped()
    goal.header.frame_id, goal.pose.position.x, goal.pose.orientation.w = "camera", 50.0, 1.0
    publisher.publish(goal)
    truth.wait(len(truth.messages) + 50)
    assert near(truth, before, 0.05)
    publisher.unregister()


def test_quadrotor_flies_to_a_goal_and_ends_when_it_is_asked_to(start, hear, ros_master):
    options = ("_world:=plane", "_camera:=false", "_rate:=2")
    process = start("quadrotor", "__ns:=/air", *options, node="air/quadrotor")
    truth = hear("/air/ground_truth/odom", Odometry)
    sensed = [
        hear(topic, kind)
        for topic, kind in (
            ("/air/imu/data", Imu),
            ("/air/imu/mag", MagneticField),
            ("/air/pressure", FluidPressure),
            ("/air/fix", NavSatFix),
        )
    ]
    assert '<robot name="quadrotor"' in rospy.get_param("/air/robot_description")
    assert not ask("/air/quadrotor/start_mission").success
    assert ask("/air/quadrotor/take_off").success
    wait_for(lambda: place(truth)[0][2] > 1, "a metre of height")
    publisher = rospy.Publisher("/air/goal", PoseStamped, queue_size=1)
    wait_for(publisher.get_num_connections, "it to listen")
    goal = PoseStamped()
    goal.header.frame_id, goal.pose.orientation.w = "map", 1.0
    goal.pose.position.x, goal.pose.position.y, goal.pose.position.z = 2.0, -1.0, 3.0
    publisher.publish(goal)
    wait_for(lambda: near(truth, (2.0, -1.0, 3.0), 0.4), "the goal")
    assert ask("/air/quadrotor/land").success
    wait_for(lambda: place(truth)[0][2] < 0.3, "the ground")
    publisher.unregister()
    for heard in sensed:
        heard.wait()
    process.send_signal(signal.SIGINT)
    assert process.wait(PATIENCE_S) == 0
