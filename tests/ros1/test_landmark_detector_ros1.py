"""The node that runs a network, on a ROS graph where nobody installed vision_msgs."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rospy
from ros_graph import Heard, Master, wait_for
from sensor_msgs.msg import Image

from ros_visualise.data import Detections, VisionInfo
from ros_visualise.running.executables import command_of
from ros_visualise.runtime.ros1.messages import message_class

pytest.importorskip("onnxruntime", reason="pip install 'ros_visualise[detect]' to run this")
sys.path.insert(0, str(Path(__file__).parents[1] / "landmarks" / "networks"))

import made_networks as made


def test_a_thing_is_found_with_the_stamp_and_frame_of_its_image(
    ros_master: Master, start: Callable[..., Any], hear: Callable[..., Heard], tmp_path: Path
) -> None:
    model = made.yolo_8(tmp_path / "n.onnx", 128, 96)
    found = hear("/detections", message_class(Detections.type_name))
    start("landmark_detector", f"_model:={model}")
    publisher = rospy.Publisher("/image_raw", Image, queue_size=5)
    try:
        pixels = np.full((96, 128), 40, np.uint8)
        pixels[30, 71] = 255
        image = Image(height=96, width=128, step=128, encoding="mono8", data=pixels.tobytes())
        image.header.stamp, image.header.frame_id = rospy.Time(12, 500), "cam"
        message = wait_for(lambda: publisher.publish(image) or found.messages, "detections")[0]
    finally:
        publisher.unregister()
    assert (message.header.stamp, message.header.frame_id) == (rospy.Time(12, 500), "cam")
    (one,) = message.detections
    assert (one.bbox.center.x, one.bbox.center.y) == pytest.approx((71, 30), abs=1e-3)
    assert (one.bbox.size_x, one.bbox.size_y) == pytest.approx(made.SIZE, abs=1e-3)
    assert [(what.id, what.score) for what in one.results] == [(made.CLASS, made.SCORE)]
    about = hear("/vision_info", message_class(VisionInfo.type_name))  # late: it is latched
    about.wait(1)
    assert about.messages[0].database_location == model
    assert "/debug_image" in ros_master.call("rostopic", "list")


def test_a_network_that_is_none_is_one_line(ros_master: Master, tmp_path: Path) -> None:
    none = tmp_path / "none.onnx"
    node = ros_master.run(*command_of("landmark_detector"), f"_model:={none}")
    said, _ = node.communicate(timeout=60)
    assert node.returncode == 2
    assert f"{none}: no such file; give the ONNX file of a network" in said
