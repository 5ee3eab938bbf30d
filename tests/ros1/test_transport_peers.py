"""Our transport among the tools and the nodes in C++ that ROS 1 comes with."""

import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import rosbag
from peers import connect, running
from ros_graph import wait_for
from sensor_msgs.msg import CameraInfo, Image

from ros_visualise.runtime.ros1.topics import Ros1Publisher, Ros1Subscriber

HEIGHT, WIDTH = 240, 321  # an odd width
COUNT = 10


def picture(number: int) -> Any:
    """A picture with edges, another one for each number."""
    pixels = np.full((HEIGHT, WIDTH, 3), (40, 80, 20), np.uint8)
    return cv2.circle(pixels, (160, 120), 10 + 9 * number, (10 * number, 255, 200), -1)


def message(number: int) -> Image:
    made = Image(height=HEIGHT, width=WIDTH, encoding="bgr8", step=3 * WIDTH)
    made.header.stamp.secs, made.header.frame_id = number, "camera"
    made.data = picture(number)
    return made


@pytest.fixture
def publisher(ros_master, request):
    publisher = Ros1Publisher(f"/peers/{request.node.name.partition('[')[0]}", Image)
    yield publisher
    publisher.close()


def publish_until(publisher: Ros1Publisher, condition: Any, what: str) -> Any:
    """Publish pictures, one after another, until somebody has got enough."""
    number = 0

    def step() -> Any:
        nonlocal number
        number += 1
        publisher.publish(message(number % COUNT))
        return condition()

    return wait_for(step, what)


def test_rostopic_reads(publisher, ros_master):
    echo = ("rostopic", "echo", "--noarr", "-n", "1", publisher.name)
    with running(ros_master, *echo) as process:
        connect(publisher)
        publisher.publish(message(3))
        said = process.communicate(timeout=60)[0]
    assert f"height: {HEIGHT}" in said
    assert 'frame_id: "camera"' in said
    assert "secs: 3" in said
    assert f"array type: uint8, length: {HEIGHT * WIDTH * 3}" in said


def test_rostopic_hz_counts(publisher, ros_master):
    with running(ros_master, "rostopic", "hz", "-w", "5", publisher.name) as process:
        connect(publisher)
        said = publish_until(publisher, lambda: rate(process), "a rate")
    assert "average rate" in said


def rate(process: Any) -> str:
    line = process.stdout.readline()
    return line if "average rate" in line else ""


def test_rosbag_records_the_bytes(publisher, ros_master, tmp_path: Path):
    path = tmp_path / "recorded.bag"
    record = ("rosbag", "record", "-O", str(path), "-l", str(COUNT), publisher.name)
    with running(ros_master, *record) as process:
        connect(publisher)
        for number in range(COUNT):
            publisher.publish(message(number))
            publisher.flush(60)
            time.sleep(0.02)
        process.communicate(timeout=60)
    with rosbag.Bag(str(path)) as bag:
        found = [read for _, read, _ in bag.read_messages()]
    assert [read.header.stamp.secs for read in found] == list(range(COUNT))
    for number, read in enumerate(found):
        assert read.data == picture(number).tobytes()
        assert (read.header.seq, read.encoding, read.step) == (number + 1, "bgr8", 3 * WIDTH)


def test_rosbag_plays_to_ours(ros_master, tmp_path: Path):
    path = tmp_path / "played.bag"
    with rosbag.Bag(str(path), "w") as bag:
        for number in range(COUNT):
            played = message(number)
            played.data = played.data.tobytes()
            bag.write("/peers/played", played)
    got: list[Image] = []
    subscriber = Ros1Subscriber("/peers/played", Image, got.append)
    ros_master.call("rosbag", "play", "-d", "1", "--wait-for-subscribers", str(path))
    wait_for(lambda: len(got) == COUNT, "the bag")
    subscriber.close()
    for number, read in enumerate(got):
        np.testing.assert_array_equal(read.data, picture(number).reshape(-1))


def test_a_relay_in_cpp_passes_all_on(publisher, ros_master):
    got: list[Image] = []
    relayed = f"{publisher.name}_relay"
    subscriber = Ros1Subscriber(relayed, Image, got.append)
    with running(ros_master, "/usr/lib/topic_tools/relay", publisher.name, relayed):
        connect(publisher)
        publish_until(publisher, lambda: got, "the first one")
        wait_for(lambda: subscriber.connections == 1, "the relay")
        for number in range(COUNT, 2 * COUNT):
            publisher.publish(message(number))
            wait_for(lambda number=number: got[-1].header.stamp.secs == number, "the next one")
    subscriber.close()
    passed = [read for read in got if read.header.stamp.secs >= COUNT]  # the first ones came late
    for number, read in enumerate(passed, COUNT):
        assert (read.header.stamp.secs, read.header.frame_id) == (number, "camera")
        np.testing.assert_array_equal(read.data, picture(number).reshape(-1))


def test_edges_in_cpp_come_back(publisher, ros_master):
    got: list[Image] = []
    node = ("/usr/lib/opencv_apps/edge_detection", "__name:=cpp_edges", "_debug_view:=false")
    info = Ros1Publisher("/peers/camera_info", CameraInfo)
    subscriber = Ros1Subscriber("/cpp_edges/image", Image, got.append)
    with running(ros_master, *node, f"image:={publisher.name}"):
        connect(publisher)
        publish_until(publisher, lambda: len(got) > 3, "edges")
    subscriber.close()
    info.close()
    for read in got:
        assert (read.height, read.width) == (HEIGHT, WIDTH)
        assert read.data.nbytes == read.step * HEIGHT
        assert 0 < (read.data > 0).mean() < 0.2


@pytest.mark.parametrize(
    ("executable", "names"), [("extract_images", "%04i.png"), ("image_saver", "%04i.%s")]
)
def test_image_view_saves_the_pixels(publisher, ros_master, tmp_path: Path, executable, names):
    options = (f"_filename_format:={tmp_path}/{names}", "_sec_per_frame:=0.01")
    node = (f"/usr/lib/image_view/{executable}", f"image:={publisher.name}", *options)
    with running(ros_master, *node):
        connect(publisher)
        publish_until(publisher, lambda: len(list(tmp_path.iterdir())) > 3, "files")
    for path in sorted(tmp_path.iterdir())[:3]:
        saved = cv2.imread(str(path)).astype(int)
        difference = min(np.abs(saved - picture(number)).mean() for number in range(COUNT))
        assert difference == 0 if path.suffix == ".png" else difference < 1
