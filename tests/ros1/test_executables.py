"""Our executables on a real graph, as stock ROS sees them."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from dynamic_reconfigure.client import Client
from made_videos import numbered, write_video
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PathMessage
from ros_graph import Heard, Master, end, free_port, wait_for
from rosgraph_msgs.msg import Clock, Log
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from ros_visualise.running.executables import command_of

FRAMES = 12
ROOT = Path(__file__).parents[2]
CALIBRATION = """
image_width: 160
image_height: 120
camera_name: drone
camera_matrix: {rows: 3, cols: 3, data: [150, 0, 80, 0, 151, 60, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, -0.2, 0, 0, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [150, 0, 80, 0, 0, 151, 60, 0, 0, 0, 1, 0]}
"""


@pytest.fixture
def publish(ros_master: Master) -> Iterator[Callable[[str, Any], rospy.Publisher]]:
    """A stock publisher that has a subscriber."""
    publishers: list[rospy.Publisher] = []

    def publish(topic: str, message_class: Any) -> rospy.Publisher:
        publisher = rospy.Publisher(topic, message_class, queue_size=10)
        publishers.append(publisher)
        wait_for(publisher.get_num_connections, f"a subscriber of {topic}")
        return publisher

    yield publish
    for one in publishers:
        one.unregister()


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_video(tmp_path_factory.mktemp("video") / "v.mkv", numbered(FRAMES, 160, 120))


def test_a_stamp_that_cannot_be_held_costs_that_message_alone(start, hear, publish):
    log = hear("/rosout", Log)
    start("edge_detector")
    edges = hear("/edges", Image)
    publisher = publish("/processed_image", Image)
    pixels = np.zeros((12, 16), np.uint8)
    until_heard(publisher, image_of(pixels, 10), edges)
    publisher.publish(image_of(pixels, 2**31 + 5))
    wait_for(lambda: any("message rejected" in line.msg for line in log.messages), "a word")
    publisher.publish(image_of(pixels, 20))
    wait_for(lambda: edges.messages[-1].header.stamp.secs == 20, "the next image")
    assert {image.header.stamp.secs for image in edges.messages} == {10, 20}


def play(node: str = "streamer") -> None:
    """Let a source that waits begin."""
    client = Client(f"/{node}", timeout=60)
    client.update_configuration({"paused": False})
    client.close()


def until_heard(publisher: rospy.Publisher, message: Any, heard: Heard) -> Any:
    """The first that comes of a message, which is sent until all are connected at both ends."""
    return wait_for(lambda: publisher.publish(message) or heard.messages, "an answer")[0]


def image_of(pixels: np.ndarray, stamp_s: float, frame_id: str = "cam") -> Image:
    message = Image(height=pixels.shape[0], width=pixels.shape[1], step=pixels.strides[0])
    message.encoding = "mono8" if pixels.ndim == 2 else "bgr8"
    message.header.stamp, message.header.frame_id = rospy.Time(stamp_s), frame_id
    message.data = pixels.tobytes()
    return message


def pixels_of(message: Image) -> np.ndarray:
    shape = (message.height, message.width) + (() if message.encoding == "mono8" else (3,))
    return np.frombuffer(message.data, np.uint8).reshape(shape)


def test_a_video_is_published_once_to_its_end(start, hear, video):
    images = hear("image_raw", Image)
    infos = hear("camera_info", CameraInfo)
    streamer = start("streamer", f"_path:={video}", "_paused:=true")
    wait_for(lambda: images.subscriber.get_num_connections(), "the streamer")
    wait_for(lambda: infos.subscriber.get_num_connections(), "the streamer")
    before = rospy.Time.now()
    play()
    assert streamer.wait(60) == 0
    wait_for(lambda: not images.subscriber.get_num_connections(), "the last image")
    wait_for(lambda: not infos.subscriber.get_num_connections(), "the last calibration")
    received = images.since(before)  # without the one that a paused video shows
    assert len(received) == FRAMES - 1
    for message, pixels in zip(received, numbered(FRAMES, 160, 120)[1:], strict=True):
        assert (message.encoding, message.step) == ("bgr8", 480)
        assert message.header.frame_id == "camera_optical"
        np.testing.assert_array_equal(pixels_of(message), pixels)
    seqs = [message.header.seq for message in received]
    assert seqs == list(range(seqs[0], seqs[0] + FRAMES - 1))
    gaps_s = np.diff([message.header.stamp.to_sec() for message in received])
    assert gaps_s.min() > 0
    assert np.median(gaps_s) == pytest.approx(0.04, abs=1e-4)
    assert [m.header.stamp for m in infos.since(before)] == [m.header.stamp for m in received]
    assert not any(infos.messages[0].K)  # not calibrated


def test_who_has_subscribed_before_misses_nothing_of_a_film_played_as_fast_as_possible(
    start, hear, video
):
    images, jpegs = hear("image_raw", Image), hear("image_raw/compressed", CompressedImage)
    for _ in range(3):  # each is over in a moment
        heard = len(images.messages), len(jpegs.messages)
        streamer = start("streamer", f"_path:={video}", "_rate:=0", wait=False)
        streamer.communicate(timeout=60)
        assert streamer.returncode == 0
        wait_for(lambda: not images.subscriber.get_num_connections(), "the last image")
        wait_for(lambda: not jpegs.subscriber.get_num_connections(), "the last JPEG")
        came = len(images.messages) - heard[0], len(jpegs.messages) - heard[1]
        assert came == (FRAMES, FRAMES)


def test_a_video_that_has_ended_does_not_start_paused_the_next_time(start, hear, video):
    images, diagnostics = hear("image_raw", Image), hear("/diagnostics", DiagnosticArray)
    begun = start("streamer", f"_path:={video}", "_stay:=true")

    def ended() -> bool:
        said = [one for array in diagnostics.messages for one in array.status]
        return any(("ended", "True") in [(v.key, v.value) for v in one.values] for one in said)

    wait_for(ended, "the end of the video")
    end(begun)
    before = rospy.Time.now()
    start("streamer", f"_path:={video}", "_stay:=true")
    wait_for(lambda: len(images.since(before)) > 1, "images of the second start")


def test_a_calibration_goes_with_the_images_and_their_size(start, hear, video, tmp_path):
    file = tmp_path / "drone.yaml"
    file.write_text(CALIBRATION)
    raw = hear("camera_info", CameraInfo)
    half = hear("processed_image/camera_info", CameraInfo)
    start("fps_control")
    start("filters", "_scale:=0.5")
    start("streamer", f"_path:={video}", "_loop:=true", f"_camera_info_url:=file://{file}")
    info = raw.wait()[-1]
    assert info.header.frame_id == "camera_optical"
    assert (info.width, info.height, info.K[0], info.K[2]) == (160, 120, 150, 80)
    assert info.D[:2] == (0.1, -0.2)
    info = half.wait()[-1]
    assert (info.width, info.height, info.K[0]) == (80, 60, 75)
    assert info.K[2] == pytest.approx((80 + 0.5) / 2 - 0.5)


def test_compressed_images_are_made_for_whoever_wants_them(start, hear, video):
    compressed = hear("image_raw/compressed", CompressedImage)
    edges = hear("edges", Image)
    start("fps_control", "_image_transport:=compressed")
    start("filters", "_image_transport:=compressed")
    start("edge_detector", "_image_transport:=compressed")
    start("streamer", f"_path:={video}", "_loop:=true")
    message = compressed.wait()[-1]
    assert message.format == "bgr8; jpeg compressed bgr8"
    pixels = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)
    difference = min(np.abs(pixels.astype(int) - i).mean() for i in numbered(FRAMES, 160, 120))
    assert difference < 3
    message = edges.wait()[-1]
    assert message.encoding == "mono8"
    assert pixels_of(message).shape == (120, 160)


def test_nothing_is_sent_that_nobody_wants(start, ros_master, video):
    start("streamer", f"_path:={video}", "_loop:=true")
    start("fps_control")
    some = 20 * 3 * 160 * 120  # bytes of images
    wait_for(lambda: published(ros_master, "/streamer")["/image_raw"] > some, "images")
    assert published(ros_master, "/fps_control")["/controlled_stream"] == 0


def published(master: Master, node: str) -> dict[str, int]:
    """Topic -> bytes that a node has sent."""
    import xmlrpc.client

    _, _, uri = master.proxy().lookupNode("/tests", node)
    _, _, (topics, *_) = xmlrpc.client.ServerProxy(uri).getBusStats("/tests")
    return {topic: size for topic, size, _ in topics}


def test_topics_can_cross(start, hear, publish):
    start("fps_control", "image_raw:=/cam/a", "controlled_stream:=/image_raw")
    heard = hear("/image_raw", Image)
    wait_for(lambda: heard.subscriber.get_num_connections(), "fps_control")
    cross = image_of(np.full((4, 6, 3), 9, np.uint8), 12.5)
    message = until_heard(publish("/cam/a", Image), cross, heard)
    assert message.header.stamp == rospy.Time(12.5)
    assert message.header.frame_id == "cam"


def test_odd_images_of_others_are_taken_or_refused_with_a_word(start, hear, publish):
    log = hear("/rosout", Log)
    edges = hear("edges", Image)
    node = start("edge_detector")
    source = publish("processed_image", Image)
    good = image_of(np.zeros((8, 8), np.uint8), 1)
    broken = image_of(np.zeros((8, 8), np.uint8), 2)
    broken.data = broken.data[:-1]
    strange = image_of(np.zeros((8, 8), np.uint8), 3)
    strange.encoding = "32FC7"
    for message in (broken, strange):
        source.publish(message)
    until_heard(source, good, edges)
    assert node.poll() is None

    def says() -> bool:
        said = [message.msg for message in log.messages if message.name == "/edge_detector"]
        return any("/processed_image" in text and "63" in text for text in said)

    wait_for(says, "a word about the broken image")


def test_a_node_reports_to_diagnostics(start, hear, video):
    diagnostics = hear("/diagnostics", DiagnosticArray)
    start("streamer", f"_path:={video}", "_loop:=true")
    start("fps_control", "_fps:=5")

    def reported() -> dict[str, str]:
        for array in diagnostics.messages:
            for status in array.status:
                told = {value.key: value.value for value in status.values}
                if status.name == "/fps_control" and "dropped/rate" in told:
                    return told
        return {}

    told = wait_for(reported, "figures of fps_control")
    assert told["requested_hz"] == "5"
    assert int(told["received"]) >= int(told["processed"]) > 0


@pytest.mark.parametrize(
    ("name", "args", "says"),
    [
        ("edge_detector", ["_low:=900"], "low=900: must be from 0 to 800"),
        ("edge_detector", ["_method:=magic"], "choose one of canny"),
        ("edge_detector", ["_view:=tv"], "view=tv: choose web, windows or none"),
        ("edge_detector", ["_image_transport:=pigeon"], "use raw or compressed"),
        ("edge_detector", ["edges:=/a", "processed_image:=/a"], "both its input and its output"),
        ("streamer", [], "give a video file"),
        ("streamer", ["_path:=/nowhere.mp4"], "/nowhere.mp4"),
        ("streamer", ["_path:=package://no_such/x.mp4"], "no package 'no_such'"),
        ("node", [], "FILE.py:NAME"),
        ("node", ["/nowhere.py:x"], "/nowhere.py"),
        ("pipeline", ["_nodes:=filters nonsense"], "nonsense"),
        ("viewer", ["_record_dir:=/nowhere"], "/nowhere: no such folder for recordings"),
        ("filters", ["_record_dir:=/nowhere"], "/nowhere: no such folder for recordings"),
    ],
)
def test_wrong_use_is_one_line_and_status_2(start, name, args, says):
    node = start(name, *args, wait=False)
    said = node.communicate(timeout=60)[0]
    assert node.returncode == 2
    assert says in said
    assert "Traceback" not in said


def test_a_node_waits_for_its_master_and_can_be_ended_meanwhile(ros_master):
    environment = {**ros_master.environment, "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}"}
    node = subprocess.Popen(
        command_of("filters"),
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    try:
        said = node.stdout.readline()
        if "rosdep" in said:  # rospkg's own word where rosdep is installed and was never set up
            said = node.stdout.readline()
        node.send_signal(signal.SIGINT)
        rest, _ = node.communicate(timeout=60)
    finally:
        end(node)
    assert said.strip().endswith("start one with: roscore")
    assert environment["ROS_MASTER_URI"] in said
    assert (rest, node.returncode) == ("", 0)


@pytest.mark.parametrize("uri", ["nonsense", "", "http://localhost:port"])
def test_an_address_of_the_master_that_is_not_valid_is_wrong_usage(ros_master, uri):
    environment = {**ros_master.environment, "ROS_MASTER_URI": uri}
    command = command_of("filters")
    done = subprocess.run(command, env=environment, text=True, capture_output=True, timeout=60)
    assert done.returncode == 2
    assert "set ROS_MASTER_URI=http://HOST:11311" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr


def test_a_closed_terminal_ends_a_node_as_ctrl_c_does(start):
    ended = []
    for number in (signal.SIGINT, signal.SIGHUP):
        node = start("filters", f"__name:=ended_by_{number}")
        node.send_signal(number)
        said = node.communicate(timeout=60)[0]
        ended.append((node.returncode, "Traceback" in said))
    assert ended == [(0, False), (0, False)]


def test_a_node_of_ones_own(start, hear, publish):
    heard = hear("posterize", Image)
    example = f"{ROOT / 'examples' / '01_own_filter.py'}:posterize"
    start("node", example, "image:=/image_raw", node="posterize")
    wait_for(lambda: heard.subscriber.get_num_connections(), "posterize")
    own = image_of(np.full((4, 6, 3), 9, np.uint8), 3)
    message = until_heard(publish("/image_raw", Image), own, heard)
    assert message.header.stamp == rospy.Time(3)


def test_a_path_is_there_for_latecomers(start, hear, publish):
    start("path")
    odom = publish("odom", Odometry)
    early = hear("path", PathMessage)
    for number in range(30):
        message = Odometry()
        message.header.stamp, message.header.frame_id = rospy.Time(1 + number), "odom"
        message.pose.pose.position.x = float(number)
        message.pose.pose.orientation.w = 1.0
        odom.publish(message)
        wait_for(lambda number=number: length(early) == number + 1, "a longer path")
    late = hear("path", PathMessage)
    path = late.wait()[-1]
    assert path.header.frame_id == "odom"
    assert [pose.pose.position.x for pose in path.poses] == [float(n) for n in range(30)]
    assert [pose.header.stamp.secs for pose in path.poses] == [1 + n for n in range(30)]


def test_the_last_poses_are_in_the_path_though_no_message_follows(start, hear, publish):
    start("path", "_min_distance:=0.1")
    odom = publish("odom", Odometry)
    paths = hear("path", PathMessage)
    for number in range(8):  # at 50 Hz, of which 5 Hz are published: only the first is due
        message = Odometry()
        message.header.stamp, message.header.frame_id = rospy.Time.from_sec(1 + number / 50), "odom"
        message.pose.pose.position.x = float(number)
        message.pose.pose.orientation.w = 1.0
        odom.publish(message)
    wait_for(lambda: length(paths) == 8, "the whole path")


def length(paths: Heard) -> int:
    return len(paths.messages[-1].poses) if paths.messages else 0


def test_without_a_screen_a_node_says_so_once_and_runs(
    start, hear, publish, monkeypatch, ros_master
):
    monkeypatch.setitem(ros_master.environment, "DISPLAY", "")
    node = start("edge_detector", "_view:=windows")
    edges = hear("edges", Image)
    wait_for(lambda: edges.subscriber.get_num_connections(), "edge_detector")
    dark = image_of(np.zeros((8, 8), np.uint8), 1)
    until_heard(publish("processed_image", Image), dark, edges)
    node.terminate()
    said = node.communicate(timeout=60)[0]
    assert said.count("continuing without") == 1


def test_time_that_stands_still_is_said_with_what_mends_it(start, video, ros_master):
    rospy.set_param("/use_sim_time", True)
    try:
        node = start("streamer", f"_path:={video}", wait=False)
        said = ""
        while "rosparam delete /use_sim_time" not in said:
            line = node.stdout.readline()
            assert line, "it ended without a word"
            said += line
        assert "nothing publishes /clock" in said
    finally:
        rospy.delete_param("/use_sim_time")


def test_simulated_time_paces_and_stamps(start, hear, publish, video, ros_master):
    rospy.set_param("/use_sim_time", True)
    try:
        images = hear("image_raw", Image)
        start("streamer", f"_path:={video}", wait=False)
        clock = publish("/clock", Clock)
        now_s = 100.0
        end_s = time.monotonic() + 60
        while len(images.messages) < 5 and time.monotonic() < end_s:
            clock.publish(Clock(rospy.Time(now_s)))
            now_s += 0.01
            time.sleep(0.02)
        stamps = [message.header.stamp.to_sec() for message in images.messages[:5]]
        assert len(stamps) == 5
        assert all(100 <= stamp <= now_s for stamp in stamps)
        np.testing.assert_allclose(np.diff(stamps), 0.04, atol=0.011)
        due = 1 + (now_s - stamps[0]) / 0.04
        time.sleep(0.5)  # while simulated time stands still
        assert len(images.messages) <= due + 1
    finally:
        rospy.delete_param("/use_sim_time")


def test_a_port_in_use_is_said_in_the_words_of_ros(start):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        viewer = start("viewer", f"_port:={port}", wait=False)
        said = viewer.communicate(timeout=60)[0]
    assert viewer.returncode == 2
    assert f"_port:={port + 1}" in said
    assert "--port" not in said


def test_the_page_opens_by_its_printed_address_which_is_not_published(start, hear):
    log, port = hear("/rosout", Log), free_port()
    viewer = start("viewer", f"_port:={port}", wait=False)
    own, view = (re.search(r"http://[^;\s]+", line)[0] for line in printed(viewer))
    assert status(own) == status(view) == 200
    assert status(f"http://127.0.0.1:{port}") == status(own[:-1]) == 403
    log.wait()  # which tells of the refused request
    tokens = [address.rpartition("/")[2] for address in (own, view)]
    assert all(len(token) >= 20 for token in tokens)
    assert not any(token in message.msg for token in tokens for message in log.messages)


def printed(viewer: subprocess.Popen[str]) -> Iterator[str]:
    """The lines that hold an address."""
    for line in viewer.stdout:
        if "http://" in line:
            yield line
        if "read-only" in line:
            return


def status(address: str) -> int:
    try:
        with urllib.request.urlopen(address, timeout=60) as answer:
            return answer.status
    except urllib.error.HTTPError as refused:
        return refused.code


def test_a_page_without_a_token(start):
    port = free_port()
    viewer = start("viewer", f"_port:={port}", "_token:=false", wait=False)
    line = next(line for line in viewer.stdout if "open http" in line)
    assert f"open http://127.0.0.1:{port} " in line
    assert status(f"http://127.0.0.1:{port}") == 200


def test_a_token_is_wanted_or_not(start):
    viewer = start("viewer", f"_port:={free_port()}", "_token:=maybe", wait=False)
    said = viewer.communicate(timeout=60)[0]
    assert (viewer.returncode, "token=maybe: give true or false" in said) == (2, True)
