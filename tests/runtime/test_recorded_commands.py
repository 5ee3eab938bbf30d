"""What a source is told from outside the graph is recorded too, among what it gives."""

from dataclasses import replace

import numpy as np
import pytest

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import Header, Image, Twist
from ros_visualise.graph import Graph, SourceNode
from ros_visualise.nodes import NoParams, source
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback

PERIOD_NS = 100_000_000
START_NS = 1_700_000_000_000_000_000


class Shutter:
    """An image each tenth of a second, without end."""

    duration_ns = None

    def read(self, start_ns):
        for number in range(start_ns // PERIOD_NS, 1000):
            yield number * PERIOD_NS, Image(np.zeros((2, 3), np.uint8), "mono8")


@source("robot", params=NoParams, inputs={"cmd_vel": Twist}, outputs={"image": Image})
class Robot:
    def __init__(self, params, playback):
        self.playback = playback

    def messages(self):
        for stamp_ns, image in self.playback.run(Shutter()):
            yield "image", replace(image, header=Header(START_NS + stamp_ns, "camera"))

    def receive(self, port, message):
        if not np.isfinite(message.linear_xyz).all():
            raise RosVisualiseError("that is no velocity")

    def close(self):
        pass


def velocity(x):
    return Twist(np.array([x, 0, 0.0]), np.array([0, 0, x / 2]))


class Drive:
    """A robot whose images are made one by one, on command."""

    def __init__(self, target, topics=()):
        inputs, outputs = {"cmd_vel": "/cmd_vel"}, {"image": "/image_raw"}
        graph = Graph(SourceNode("robot", Robot.declared, NoParams(), inputs, outputs), ())
        self.playback = Playback(rate=0)
        self.playback.pause()
        self.runtime = LocalRuntime(graph, self.playback)
        self.recording = self.runtime.start_recording(target, topics=topics)
        self.images = self.runtime.subscribe("/image_raw")  # gets each after the recording

    def start(self):
        self.runtime.start()
        assert self.images.take(60) is not None

    def step(self):
        self.playback.step()
        assert self.images.take(60) is not None

    def tell(self, x):
        self.runtime.publish("/cmd_vel", velocity(x))


def read(path):
    """(Topic, periods since the start, velocity ahead) in the order of the file."""
    recording = open_recording(path)
    try:
        return [
            (e.topic, (e.stamp_ns - START_NS) / PERIOD_NS, speed_of(e.message.content))
            for e in recording.read(topics=["/image_raw", "/cmd_vel"])
        ]
    finally:
        recording.close()


def speed_of(message):
    return message.linear_xyz[0] if isinstance(message, Twist) else None


@pytest.mark.parametrize("name", ["out.bag", "out.mcap"])
def test_a_command_is_recorded_at_the_time_of_the_newest_message(name, tmp_path):
    drive = Drive(tmp_path / name)
    drive.start()
    drive.tell(0.5)
    drive.tell(0.25)
    drive.step()
    drive.step()
    drive.tell(-1)
    drive.step()
    drive.runtime.stop()
    image, command = "/image_raw", "/cmd_vel"
    assert read(tmp_path / name) == [
        (image, 0, None),
        (command, 0, 0.5),
        (command, 0, 0.25),
        (image, 1, None),
        (image, 2, None),
        (command, 2, -1),
        (image, 3, None),
    ]
    recording = open_recording(tmp_path / name)
    assert recording.topics[command].type.name == "geometry_msgs/msg/Twist"
    recording.close()
    assert (drive.recording.written, drive.recording.dropped) == (7, 0)


def test_a_command_before_the_first_message_comes_with_it(tmp_path):
    drive = Drive(tmp_path / "out.mcap")
    drive.tell(1)
    drive.start()
    drive.runtime.stop()
    assert read(tmp_path / "out.mcap") == [("/image_raw", 0, None), ("/cmd_vel", 0, 1)]


def test_commands_alone_are_recorded_at_the_same_times(tmp_path):
    drive = Drive(tmp_path / "out.mcap", ["/cmd_vel"])
    drive.start()
    drive.step()
    drive.tell(1)
    drive.runtime.stop()
    assert read(tmp_path / "out.mcap") == [("/cmd_vel", 1, 1)]


def test_what_the_source_refuses_is_not_recorded(tmp_path):
    drive = Drive(tmp_path / "out.mcap")
    drive.start()
    with pytest.raises(RosVisualiseError):
        drive.tell(np.nan)
    drive.runtime.stop()
    assert read(tmp_path / "out.mcap") == [("/image_raw", 0, None)]


def test_many_commands_do_not_bring_messages_out_of_their_order(tmp_path):
    drive = Drive(tmp_path / "out.mcap")
    drive.start()
    for _ in range(20):
        drive.tell(1)
    for _ in range(5):
        drive.step()
    drive.runtime.stop()
    found = read(tmp_path / "out.mcap")
    assert [place for topic, place, _ in found if topic == "/image_raw"] == [0, 1, 2, 3, 4, 5]
    assert [place for _, place, _ in found] == [0] * 21 + [1, 2, 3, 4, 5]
