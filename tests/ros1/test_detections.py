"""Detections on a ROS graph where nobody installed vision_msgs, and in what rosbag records."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import rosbag
from ros_graph import Heard, Master

from ros_visualise.data import Detection, Detections, Header, Hypothesis
from ros_visualise.messages import from_message
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.ros1.messages import message_class
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_recording

TOPIC = "/found"
COUNT = 5


def found(number: int) -> Detections:
    box = Detection(np.array([10.0, 20]), np.array([4.0, 5]), 0.5, (Hypothesis("3", 0.75),))
    return Detections((box,) * number, Header(10**9 * (number + 1), "camera"))


def test_detections_of_an_mcap_are_played_and_recorded(
    ros_master: Master, start: Callable[..., Any], hear: Callable[..., Heard], tmp_path: Path
) -> None:
    types = {TOPIC: TopicType(Detections.type_name)}
    with open_recorder(f"{tmp_path}/found.mcap", types) as recorder:
        for number in range(COUNT):
            recorder.write(TOPIC, found(number))
    copy = tmp_path / "copy.bag"
    record = ros_master.run("rosbag", "record", "-O", str(copy), "-l", str(COUNT), TOPIC)
    heard = hear(TOPIC, message_class(Detections.type_name))
    start("player", f"_path:={recorder.path}", "_loop:=true", "_rate:=2", wait=False)
    heard.wait(COUNT)
    assert "vision_msgs/Detection2DArray" in ros_master.call("rostopic", "type", TOPIC)
    record.communicate(timeout=60)
    assert record.returncode == 0
    with rosbag.Bag(str(copy)) as bag:
        (told,) = bag.get_type_and_topic_info().topics.values()
        messages = [message for _, message, _ in bag.read_messages()]
    assert (told.msg_type, told.message_count) == ("vision_msgs/Detection2DArray", COUNT)
    assert sum(len(message.detections) for message in messages) > 0
    printed = ros_master.call("rostopic", "echo", "-b", str(copy), "-p", TOPIC)
    assert printed.count("\n") == COUNT + 1
    with closing(open_recording(copy)) as recording:
        again = [entry.message.content for entry in recording.read(topics=[TOPIC])]
    for one, message in zip(again, messages, strict=True):
        assert len(one.detections) == len(message.detections)
        assert {(box.class_id, box.theta) for box in one.detections} <= {("3", 0.5)}
        assert from_message(message, Detections).header == one.header
