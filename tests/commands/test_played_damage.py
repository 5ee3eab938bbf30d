"""`ros-visualise bag` with messages that nobody can use: it says so, and plays the others."""

import numpy as np
from made_videos import numbered, write_video
from mcap.reader import make_reader
from mcap.writer import Writer
from played_bags import QUICK, image, images, write_bag

from ros_visualise.data import Header, Odometry
from ros_visualise.messages.recorded import TopicType
from ros_visualise.nodes.camera import CameraSource
from ros_visualise.sinks import open_recorder


def no_pixels(stamp_ns):
    return image(stamp_ns, width=0, height=0)


def test_an_image_without_pixels_is_damaged(run, tmp_path, caplog):
    bag = write_bag(tmp_path / "r.bag", zero=images(no_pixels))
    _, said = run("bag", bag, *QUICK)
    assert "fps_control: 5 of 5 dropped (damaged)" in said
    assert "/zero: sensor_msgs/msg/Image: an image of 0x0 pixels" in caplog.text
    assert "Traceback" not in caplog.text


def test_what_is_lost_of_a_recording_is_told_by_the_exit_status(run, tmp_path, caplog):
    whole = write_bag(tmp_path / "whole.bag", a=images(count=40))
    assert run("bag", whole, *QUICK)[0] == 0
    cut = tmp_path / "cut.bag"
    cut.write_bytes(whole.read_bytes()[:-4000])
    caplog.clear()
    assert run("bag", cut, *QUICK)[0] == 1
    (said,) = caplog.messages
    assert said.startswith("player: cut off after ")
    damaged = write_bag(tmp_path / "damaged.bag", zero=images(no_pixels))
    assert run("bag", damaged, *QUICK)[0] == 1
    assert run("bag", damaged, *QUICK, "--image", "none")[0] == 0  # nobody reads them


def test_what_a_node_leaves_out_as_it_is_asked_is_not_lost(run, tmp_path):
    bag = write_bag(tmp_path / "r.bag", a=images(count=40))
    status, said = run("bag", bag, *QUICK, "--set", "fps_control.fps=2")
    assert (status, "dropped (rate)" in said) == (0, True)


def mcap_with_json(path, names, ros=True):
    """Topics of JSON, and ``/odom`` of a ROS message, unless told otherwise."""
    odometry = TopicType("nav_msgs/msg/Odometry")
    with open_recorder(str(path), {"/odom": odometry}) as recorder:
        for step in range(3):
            place = Odometry(np.zeros(3), np.array([0, 0, 0, 1.0]), header=Header(step + 1))
            recorder.write("/odom", place)
    with path.open("rb") as file:
        found = [*make_reader(file).iter_messages()]
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for schema, channel, message in found if ros else ():
            number = writer.register_schema(schema.name, schema.encoding, schema.data)
            channel = writer.register_channel(channel.topic, "cdr", number, {})
            writer.add_message(channel, message.log_time, message.data, message.log_time)
        for name in names:
            channel = writer.register_channel(name, "json", 0)
            writer.add_message(channel, 2, b"{}", 2)
        writer.finish()
    return path


def test_topics_that_cannot_be_played_are_said_in_one_line(run, tmp_path, caplog):
    names = [f"/json{number}" for number in range(5)]
    path = mcap_with_json(tmp_path / "r.mcap", names)
    status, _ = run("bag", path, *QUICK)
    assert status == 1
    assert caplog.messages == [
        f"{path}: not played: /json0, /json1, /json2 and 2 more"
        " (json: only ROS messages are supported)"
    ]
    caplog.clear()
    assert run("bag", path, *QUICK, "--topics", "/odom")[0] == 0
    assert caplog.messages == []


def test_where_nothing_can_be_played_it_is_said_why(run, tmp_path):
    status, said = run("bag", mcap_with_json(tmp_path / "r.mcap", ["/json"], ros=False), *QUICK)
    assert status == 2
    assert "nothing in it can be played: /json (json: only ROS messages are supported)" in said


def test_a_video_that_ends_early_is_said_once(run, tmp_path, caplog):
    path = write_video(tmp_path / "v.mkv", numbered(40))
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    status, said = run("video", path, *QUICK)
    assert status == 1
    assert "cut off" not in said
    (once,) = caplog.messages
    assert once.startswith("streamer: the video ends at ")


def test_what_a_camera_drops_is_not_of_what_it_gave(run, monkeypatch):
    monkeypatch.setattr(CameraSource, "report", lambda _: {"dropped": {"source": 13}})
    _, said = run("camera", "test", "--size", "64x48", "--frames", "2", *QUICK[:2])
    assert "camera: 13 dropped (source)" in said
