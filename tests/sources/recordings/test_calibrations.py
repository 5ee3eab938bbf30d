"""Each image comes with the calibration of its camera."""

import made_bags
import pytest
from made_bags import PERIOD_NS, START_NS, BagWriter

from ros_visualise.sources.opening import open_recording

IMAGE, INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
COMPRESSED = "sensor_msgs/msg/CompressedImage"


@pytest.fixture
def zoom(tmp_path):
    """Ten images from a camera whose calibration comes with every third, just before it."""
    path = tmp_path / "zoom.bag"
    with BagWriter(path) as bag:
        bag.connect("info", "/cam/camera_info", INFO)
        bag.connect("image", "/cam/image_raw", IMAGE)
        for step in range(1, 11):
            now_ns = START_NS + step * PERIOD_NS
            if step % 3 == 0:
                bag.write("info", now_ns - 1000, made_bags.camera_info(now_ns, 10.0 * step))
            bag.write("image", now_ns, made_bags.image(now_ns))
    return path


def focal_lengths(recording, *window, **choice):
    return [
        entry.message.content.camera_info.K[0, 0]
        for entry in recording.read(*window, **choice)
        if entry.topic == "/cam/image_raw"
    ]


ALL = [30, 30, 30, 30, 30, 60, 60, 60, 90, 90]


@pytest.mark.parametrize("topics", [None, ["/cam/image_raw"], ["/cam/image_raw", "/other"]])
def test_it_is_the_last_one_before_the_image_or_the_first(zoom, topics):
    recording = open_recording(zoom)
    assert focal_lengths(recording, topics=topics) == ALL


@pytest.mark.parametrize("step", range(1, 11))
def test_it_is_the_same_wherever_reading_begins(zoom, step):
    start_ns = START_NS + step * PERIOD_NS
    recording = open_recording(zoom)
    assert focal_lengths(recording, start_ns, topics=["/cam/image_raw"]) == ALL[step - 1 :]
    assert focal_lengths(recording, start_ns) == ALL[step - 1 :]


def test_what_was_not_asked_for_is_not_given(zoom):
    topics = {entry.topic for entry in open_recording(zoom).read(topics=["/cam/image_raw"])}
    assert topics == {"/cam/image_raw"}


@pytest.mark.parametrize(
    ("image", "info", "kind", "belongs"),
    [
        ("/a/image_raw", "/a/camera_info", IMAGE, True),
        ("/image_raw", "/camera_info", IMAGE, True),
        ("/a/image_raw/compressed", "/a/camera_info", COMPRESSED, True),
        ("/a/compressed", "/a/camera_info", COMPRESSED, True),
        ("/a/image_raw", "/b/camera_info", IMAGE, False),
        ("/a/left/image_raw", "/a/camera_info", IMAGE, False),
    ],
)
def test_it_stands_beside_the_image(tmp_path, image, info, kind, belongs):
    path = tmp_path / "one.bag"
    with BagWriter(path) as bag:
        bag.connect("info", info, INFO)
        bag.connect("image", image, kind)
        bag.write("info", START_NS, made_bags.camera_info(START_NS))
        bag.write("image", START_NS, b"")
    (entry,) = open_recording(path).read(topics=[image])
    assert (entry.message.calibration is not None) == belongs
