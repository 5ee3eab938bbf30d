"""The executable `landmark_localizer` on a graph where classes are numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import TransformStamped
from ros_graph import wait_for
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from ros_visualise.estimation.localization import map_file
from ros_visualise.runtime.ros1.messages import message_class


def tag(stamp: Any) -> Any:
    """Tag 3, 2 m in front of the camera, as a message of vision_msgs."""
    array = message_class("vision_msgs/msg/Detection2DArray")()
    array.header.stamp, array.header.frame_id = stamp, "camera"
    found = message_class("vision_msgs/msg/Detection2D")()
    hypothesis = message_class("vision_msgs/msg/ObjectHypothesisWithPose")()
    hypothesis.id, hypothesis.score = 3, 1.0
    hypothesis.pose.pose.position.z, hypothesis.pose.pose.orientation.w = 2.0, 1.0
    hypothesis.pose.covariance = (1e-4 * np.eye(6)).ravel().tolist()
    found.results = [hypothesis]
    array.detections = [found]
    return array


def camera_in_map() -> TFMessage:
    mounted = TransformStamped(child_frame_id="camera")
    mounted.header.frame_id = "map"
    mounted.transform.translation.x, mounted.transform.rotation.w = 5.0, 1.0
    return TFMessage([mounted])


def test_landmarks_have_names_frames_markers_and_a_map(ros_master, start, hear, tmp_path: Path):
    start(
        "landmark_localizer",
        "_class_prefix:=tag36h11_",
        f"_save_to:={tmp_path}/saved.yaml",
    )
    landmarks = hear("landmarks", message_class("vision_msgs/msg/Detection3DArray"))
    markers = hear("landmark_markers", message_class("visualization_msgs/msg/MarkerArray"))
    frames = hear("/tf_static", TFMessage)
    static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
    static.publish(camera_in_map())
    detections = rospy.Publisher(
        "detections", message_class("vision_msgs/msg/Detection2DArray"), queue_size=1
    )

    def seen() -> bool:
        detections.publish(tag(rospy.Time.now()))
        return any(message.detections for message in landmarks.messages)

    wait_for(seen, "a landmark")
    found = landmarks.messages[-1]
    assert found.header.frame_id == "map"
    pose = found.detections[0].results[0].pose.pose
    assert found.detections[0].results[0].id == 3
    np.testing.assert_allclose([pose.position.x, pose.position.z], [5, 2], atol=1e-6)
    wait_for(lambda: "tag36h11_3" in names(frames), "its frame")
    texts = {marker.text for message in markers.messages for marker in message.markers}
    assert "tag36h11_3" in texts
    assert rospy.ServiceProxy("landmark_localizer/save_map", Trigger)().success
    frame_id, (landmark,), _ = map_file.load(tmp_path / "saved.yaml")
    assert (frame_id, landmark.name) == ("map", "tag36h11_3")


def names(frames: Any) -> set[str]:
    return {one.child_frame_id for message in frames.messages for one in message.transforms}
