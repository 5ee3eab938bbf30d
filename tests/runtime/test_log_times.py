"""When a recording is played, what nodes make of it is recorded by its clock, not by the stamps."""

import numpy as np
import pytest
from mcap.records import Message
from mcap.stream_reader import StreamReader

from ros_visualise.data import Header, Image, Odometry
from ros_visualise.graph.pipelines import recording_pipeline
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback

START_NS = 1_700_000_000_000_000_000
HOUR_NS = 3_600_000_000_000
PERIOD_NS = 10_000_000  # of odometry; every fifth time an image comes with it
COUNT = 200
DERIVED = ("/controlled_stream", "/processed_image", "/edges")
TYPES = {
    "/image_raw": TopicType("sensor_msgs/msg/Image"),
    "/odom": TopicType("nav_msgs/msg/Odometry"),
}
CLOCKS = {
    "the recorder's clock": lambda log_ns: log_ns,
    "a clock an hour ahead": lambda log_ns: log_ns + HOUR_NS,
    "a clock an hour behind": lambda log_ns: log_ns - HOUR_NS,
    "no clock": lambda log_ns: 0,
}


def make_bag(path, stamp_of):
    """Images and odometry, whose stamps are what a clock made of their log times."""
    rng = np.random.default_rng(1)
    with open_recorder(str(path), TYPES, live=False) as recorder:
        for number in range(COUNT):
            log_ns = START_NS + number * PERIOD_NS
            header = Header(stamp_of(log_ns), "odom")
            quat = np.array([0, 0, 0, 1.0])
            odometry = Odometry(np.array([number, 0, 0.0]), quat, header=header)
            recorder.write("/odom", odometry, log_ns)
            if number % 5 == 4:
                log_ns += 1_000_000
                pixels = rng.integers(0, 256, (6, 8), np.uint8)
                image = Image(pixels, "mono8", Header(stamp_of(log_ns), "camera"))
                recorder.write("/image_raw", image, log_ns)
    return path


def graph_of(path, **settings):
    return recording_pipeline(open_recording(path)).configured(settings)


def record(graph, target):
    runtime = LocalRuntime(graph, Playback(rate=0))
    runtime.start_recording(target)
    runtime.start()
    assert runtime.wait(60)
    runtime.stop()
    assert not runtime.failed
    return target


def read(path):
    """(Topic, log time, stamp) of all messages as they stand in the file."""
    recording = open_recording(path)
    try:
        return [(e.topic, e.stamp_ns, e.message.header.stamp_ns) for e in recording.read()]
    finally:
        recording.close()


@pytest.fixture(params=CLOCKS.values(), ids=CLOCKS)
def stamp_of(request):
    """Log time -> stamp."""
    return request.param


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_what_is_derived_lies_beside_what_it_was_made_of(stamp_of, suffix, tmp_path):
    made = make_bag(tmp_path / "made.bag", stamp_of)
    found = read(record(graph_of(made, fps_control={"fps": 10}), tmp_path / f"out{suffix}"))
    times: dict[str, list] = {}
    for topic, log_ns, stamp_ns in found:
        times.setdefault(topic, []).append((log_ns, stamp_ns))
    images = set(times["/image_raw"])
    assert len(images) == COUNT // 5
    for topic in DERIVED:
        assert set(times[topic]) <= images
        assert len(times[topic]) == COUNT // 10  # 10 of 20 images a second
    assert set(times["/path"][:-1]) <= set(times["/odom"])
    assert len(times["/path"]) == 5 * COUNT // 100 + 1  # and the whole one at the end
    assert times["/path"][-1] == (times["/image_raw"][-1][0], times["/odom"][-1][1])
    parameters = times.get("/parameter_events", [])
    assert all(event == (START_NS, START_NS) for event in parameters)


def test_messages_stand_in_the_file_in_order_of_their_log_times(stamp_of, tmp_path):
    made = make_bag(tmp_path / "made.bag", stamp_of)
    out = record(graph_of(made), tmp_path / "out.mcap")
    with out.open("rb") as file:
        reader = StreamReader(file)
        times = [one.log_time for one in reader.records if isinstance(one, Message)]
    assert times == sorted(times)
    assert len(times) > COUNT


def test_the_same_recording_makes_the_same_file(stamp_of, tmp_path):
    made = make_bag(tmp_path / "made.bag", stamp_of)
    files = []
    for folder in (tmp_path / "first", tmp_path / "second"):
        folder.mkdir()
        out = record(graph_of(made, fps_control={"fps": 7}), folder / "out.mcap")
        files.append(out.read_bytes())
    assert files[0] == files[1]
