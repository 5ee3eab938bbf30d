"""ROS 1's own tools read the bags that are written here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rosbag
import rospy
import tf2_ros
from ros_graph import Master, end, wait_for
from sensor_msgs.msg import Image as ImageMessage

from ros_visualise.data import Header, Image, Transforms, TransformStamped
from ros_visualise.messages.qos import LATCHED
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder

TOPICS = {
    "/written/image": TopicType("sensor_msgs/msg/Image"),
    "/written/map": TopicType("sensor_msgs/msg/Image", qos=LATCHED),
    "/tf_static": TopicType("tf2_msgs/msg/TFMessage", qos=LATCHED),
}
COUNT = 30
COMPRESSIONS = ("none", "lz4", "bz2")


def image(number: int) -> Image:
    return Image(np.full((40, 50), number, np.uint8), "mono8", Header(number * 10**8, "camera"))


def placed() -> Transforms:
    x_axis_back = np.array([0, 0, 1.0, 0])
    one = TransformStamped("camera", np.array([1.0, 2, 3]), x_axis_back, Header(0, "base"))
    return Transforms((one,))


@pytest.fixture(params=[(c, live) for c in COMPRESSIONS for live in (True, False)], ids=str)
def bag(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    compression, live = request.param
    with open_recorder(f"{tmp_path}/r.bag", TOPICS, compression=compression, live=live) as recorder:
        recorder.write("/tf_static", placed())
        recorder.write("/written/map", image(0))
        for number in range(COUNT):
            recorder.write("/written/image", image(number))
    return recorder.path


def test_rosbag_tells_what_it_holds(ros_master: Master, bag: Path) -> None:
    told = ros_master.call("rosbag", "info", "--yaml", str(bag))
    assert "messages: 32\n" in told
    assert "indexed: True\n" in told
    assert "types:\n    - type: sensor_msgs/Image\n      md5: 0600213882" in told
    # definitions lack the comments of ROS's own, for which it would rewrite them
    assert "All rules defined.  Bag is ready" in ros_master.call("rosbag", "check", str(bag))


def test_rosbag_reads_every_message(bag: Path) -> None:
    with rosbag.Bag(str(bag)) as found:
        images = list(found.read_messages("/written/image"))
        (placed_at,) = found.read_messages("/tf_static")
    assert [time.to_nsec() for _, _, time in images] == [max(n * 10**8, 1) for n in range(COUNT)]
    for number, (_, message, _) in enumerate(images):
        assert message.header.stamp.to_nsec() == number * 10**8
        assert (message.width, message.height, message.encoding) == (50, 40, "mono8")
        assert message.data == bytes([number]) * 2000
    assert placed_at.message.transforms[0].transform.translation.z == 3


def test_rosbag_recovers_one_that_was_killed(ros_master: Master, tmp_path: Path) -> None:
    recorder = open_recorder(f"{tmp_path}/r.bag", TOPICS, compression="lz4")
    for number in range(COUNT):
        recorder.write("/written/image", image(number))
    killed = tmp_path / "killed.bag"
    killed.write_bytes(recorder.path.read_bytes())
    recorder.close()
    ros_master.call("rosbag", "reindex", "--quiet", str(killed))
    with rosbag.Bag(str(killed)) as found:
        assert found.get_message_count() == COUNT


def test_rosbag_plays_it(ros_master: Master, tmp_path: Path) -> None:
    with open_recorder(f"{tmp_path}/r.bag", TOPICS, compression="lz4") as recorder:
        recorder.write("/tf_static", placed())
        recorder.write("/written/map", image(0))
        for number in range(COUNT):
            recorder.write("/written/image", image(number))
    images: list[Any] = []
    listening = rospy.Subscriber("/written/image", ImageMessage, images.append)
    frames = tf2_ros.Buffer()
    transforms = tf2_ros.TransformListener(frames)
    play = ros_master.run(
        "rosbag",
        "play",
        "--keep-alive",
        "--wait-for-subscribers",
        "--rate",
        "10",
        "--quiet",
        str(recorder.path),
        "--topics",
        "/written/image",
        "/tf_static",
    )
    try:
        wait_for(lambda: len(images) >= COUNT, "the images")
        wait_for(lambda: frames.can_transform("base", "camera", rospy.Time(0)), "the transform")
        found = frames.lookup_transform("base", "camera", rospy.Time(0)).transform
        late: list[Any] = []
        latched = rospy.Subscriber("/tf_static", rospy.AnyMsg, late.append)
        wait_for(lambda: late, "what was latched")
    finally:
        end(play)
    for subscriber in (listening, latched, transforms.tf_sub, transforms.tf_static_sub):
        subscriber.unregister()
    assert [bytes(message.data)[0] for message in images] == list(range(COUNT))
    assert (found.translation.x, found.translation.y, found.translation.z) == (1, 2, 3)
    assert found.rotation.z == 1
