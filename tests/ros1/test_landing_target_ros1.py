"""The executable `landing_target` on a graph where classes are numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from ros_graph import wait_for
from tf2_msgs.msg import TFMessage

from ros_visualise.runtime.ros1.messages import message_class

PAD, HEIGHT_M = 100, 5.0


def seen(stamp: Any) -> Any:
    """The pad, 2 m ahead of the body and 1 m to its right."""
    array = message_class("vision_msgs/msg/Detection2DArray")()
    array.header.stamp, array.header.frame_id = stamp, "camera"
    hypothesis = message_class("vision_msgs/msg/ObjectHypothesisWithPose")()
    hypothesis.id, hypothesis.score = PAD, 1.0
    place, turned = hypothesis.pose.pose.position, hypothesis.pose.pose.orientation
    place.x, place.y, place.z, turned.x = 2.0, 1.0, HEIGHT_M, 1.0
    hypothesis.pose.covariance = (4e-4 * np.eye(6)).ravel().tolist()
    found = message_class("vision_msgs/msg/Detection2D")()
    found.results = [hypothesis]
    array.detections = [found]
    return array


def frames() -> TFMessage:
    """A level body over the origin, whose camera looks down, its right side ahead."""
    body, camera = TransformStamped(child_frame_id="base_link"), TransformStamped()
    body.header.frame_id, camera.header.frame_id = "odom", "base_link"
    camera.child_frame_id = "camera"
    body.transform.translation.z = HEIGHT_M
    body.transform.rotation.w = camera.transform.rotation.x = 1.0
    return TFMessage([body, camera])


def test_where_to_land_is_told_as_mavlink_wants_it_also_between_images(ros_master, start, hear):
    start("landing_target", f"_target:={PAD}", "_autopilot:=ardupilot")
    told = hear("landing_target", PoseWithCovarianceStamped)
    poses = hear("landing_target_pose", PoseStamped)
    target = hear("landing_target_odom", Odometry)
    static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
    static.publish(frames())
    kind = message_class("vision_msgs/msg/Detection2DArray")
    detections = rospy.Publisher("detections", kind, queue_size=1)
    odom = rospy.Publisher("odom", Odometry, queue_size=10)

    def is_told() -> bool:
        detections.publish(seen(rospy.Time.now()))
        return bool(told.messages and poses.messages and target.messages)

    wait_for(is_told, "a target")
    pose = told.messages[-1].pose.pose
    assert told.messages[-1].header.frame_id == "base_link_frd"
    place = [pose.position.x, pose.position.y, pose.position.z]
    np.testing.assert_allclose(place, [2, 1, HEIGHT_M], atol=1e-3)
    assert 0 < told.messages[-1].pose.covariance[0] < 0.01
    assert poses.messages[-1].pose.position.z == pose.position.z
    there = target.messages[-1].pose.pose.position
    assert target.messages[-1].header.frame_id == "odom"
    np.testing.assert_allclose([there.x, there.y, there.z], [2, -1, 0], atol=1e-3)
    before = len(told.messages)

    def is_told_again() -> bool:
        message = Odometry(child_frame_id="base_link")
        message.header.stamp, message.header.frame_id = rospy.Time.now(), "odom"
        message.pose.pose.orientation.w = 1.0
        odom.publish(message)
        return len(told.messages) > before + 3

    wait_for(is_told_again, "the target between images")
