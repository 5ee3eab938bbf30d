"""A process on a transport: what it publishes, takes and offers; no ROS is needed for it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from threading import Event
from time import sleep
from typing import Any

import numpy as np
import pytest
from hub import Hub, HubTransport
from made_videos import numbered, write_video
from waiting import wait_for

from ros_visualise.core.errors import OpenError, RosVisualiseError, UsageError
from ros_visualise.core.params import Parameters
from ros_visualise.core.supervision import PROCESS
from ros_visualise.data import (
    CameraInfo,
    CompressedImage,
    DiagnosticArray,
    Header,
    Image,
    Odometry,
    Text,
    Transforms,
    TransformStamped,
    Twist,
)
from ros_visualise.data import (
    Path as PathMessage,
)
from ros_visualise.messages.qos import LATCHED
from ros_visualise.messages.recorded import TopicType
from ros_visualise.nodes.filters import FiltersParams
from ros_visualise.running.executables.by_name import run
from ros_visualise.runtime.bridge.inputs import ImageInput
from ros_visualise.runtime.bridge.outputs import StaticFrames, StaticTransformsOutput
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.sinks import open_recorder
from ros_visualise.ui.live.topics import lines_of, topic_rows

IMAGE = Image(np.arange(24, dtype=np.uint8).reshape(4, 6), "mono8", Header(5, "camera_optical"))


class Peer:
    """Another node of the graph."""

    def __init__(self, hub: Hub) -> None:
        self.transport = HubTransport(hub, name="peer")
        self.refused: list[str] = []

    def hear(self, topic: str, kind: type) -> list[Any]:
        """What comes on a topic, from now on."""
        heard: list[Any] = []
        self.transport.subscribe(topic, kind, heard.append, self.refused.append)
        return heard

    def advertise(self, topic: str, kind: type) -> Any:
        return self.transport.advertise(topic, TopicType(kind.type_name))


@pytest.fixture
def hub() -> Hub:
    return Hub()


@pytest.fixture
def peer(hub: Hub) -> Iterator[Peer]:
    made = Peer(hub)
    yield made
    made.transport.close()


def test_nothing_is_sent_that_nobody_asked_for(hub: Hub, peer: Peer) -> None:
    with hub.running("filters"):
        images = peer.advertise("/controlled_stream", Image)
        wait_for(lambda: images.connections, "the node")
        assert peer.transport.listing().types["/processed_image/compressed"]
        heard = peer.hear("/processed_image", Image)
        images.publish(IMAGE)
        wait_for(lambda: heard, "the image")
    assert heard[0].header == IMAGE.header


def test_an_image_brings_its_calibration_to_whoever_wants_it(hub: Hub, peer: Peer) -> None:
    info = CameraInfo(4, 6, np.diag([7.0, 7, 1]), header=IMAGE.header)
    with hub.running("filters"):
        calibrations = peer.advertise("/controlled_stream/camera_info", CameraInfo)
        images = peer.advertise("/controlled_stream", Image)
        heard = peer.hear("/processed_image/camera_info", CameraInfo)
        wait_for(lambda: calibrations.connections, "the node to ask for the calibration")

        def comes() -> bool:
            calibrations.publish(info)
            images.publish(IMAGE)
            return bool(heard)

        wait_for(comes, "the calibration")
    assert heard[0].K[0, 0] == 7
    assert heard[0].header == IMAGE.header


def test_a_camera_display_finds_the_calibration_beside_the_image(
    hub: Hub, peer: Peer, tmp_path: Path
) -> None:
    """As image_transport looks for it: ``camera_info`` in the namespace of the image."""
    info = CameraInfo(4, 6, np.diag([7.0, 7, 1]), header=IMAGE.header)
    with hub.running("filters", flip="horizontal"):
        calibrations = peer.advertise("/controlled_stream/camera_info", CameraInfo)
        images = peer.advertise("/controlled_stream", Image)
        topics = ["processed_image", "processed_image/image", "processed_image/image/compressed"]
        kinds = [Image, Image, CompressedImage]
        heard = [peer.hear(f"/{topic}", kind) for topic, kind in zip(topics, kinds, strict=True)]
        infos = peer.hear("/processed_image/camera_info", CameraInfo)
        wait_for(lambda: calibrations.connections, "the node to ask for the calibration")

        def comes() -> bool:
            calibrations.publish(info)
            images.publish(IMAGE)
            return bool(infos and all(heard))

        wait_for(comes, "the image under all its names, and its calibration")
        with closing(RemoteRuntime(HubTransport(hub, name="viewer"))) as viewer:
            wait_for(lambda: "/processed_image" in viewer.graph.topics, "the topic")
            assert "/processed_image/image" not in viewer.graph.topics
    own, beside, _ = (messages[0] for messages in heard)
    assert np.array_equal(own.pixels, beside.pixels)
    assert infos[0].header == own.header == beside.header


def test_jpegs_are_as_good_as_asked(hub: Hub, peer: Peer) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (64, 64), np.uint8)
    sizes = []
    for quality in (5, 100):
        with hub.running("edge_detector", jpeg_quality=quality, method="sobel"):
            images = peer.advertise("/processed_image", Image)
            heard = peer.hear("/edges/compressed", CompressedImage)
            wait_for(lambda: images.connections, "the node")  # noqa: B023
            images.publish(replace(IMAGE, data=noise))
            sizes.append(len(wait_for(lambda: heard, "the JPEG")[0].data))  # noqa: B023
            images.close()
    assert 3 * sizes[0] < sizes[1]
    for wrong in (0, 101, 50.5, "good"):
        host = hub.host({"jpeg_quality": wrong})
        with pytest.raises(SystemExit) as ended:
            run("filters", host)
        assert ended.value.code == 2


def test_topics_of_unsupported_types_are_listed(hub: Hub, peer: Peer) -> None:
    unsupported = {"/odd": "odd_msgs/msg/<Odd>", "/chatter": "std_msgs/msg/ColorRGBA"}
    for topic, kind in {**unsupported, "/set": "dynamic_reconfigure/msg/C"}.items():
        hub.topic(topic, kind).publishers.append("/talker")
    with closing(RemoteRuntime(peer.transport)) as viewer:
        report = wait_for(viewer.report, "a report")
        assert report.unknown == unsupported
        rows = topic_rows(viewer.graph, report)
    assert [row for row in rows if len(row) == 2] == [
        ["/chatter", "std_msgs/ColorRGBA"],
        ["/odd", "odd_msgs/<Odd>"],
    ]


def test_actions_are_services_and_parameters_start_as_given(hub: Hub, peer: Peer) -> None:
    with hub.running("path", min_distance=0.0):
        odometry = peer.advertise("/odom", Odometry)
        paths = peer.hear("/path", PathMessage)
        wait_for(lambda: odometry.connections, "the node")
        pose = Odometry(np.ones(3), np.array([0.0, 0, 0, 1]), header=Header(10**9, "odom"))
        odometry.publish(pose)
        wait_for(lambda: paths and len(paths[-1].stamps_ns) == 1, "a pose on the path")
        wait_for(lambda: "/path/clear" in hub.services, "the service")
        peer.transport.call("/path/clear")
        wait_for(lambda: len(paths[-1].stamps_ns) == 0, "an empty path")
        _, parameters = hub.parameters["/path"]
        assert parameters.current.min_distance == 0
    with pytest.raises(RosVisualiseError, match="/path/nothing"):
        peer.transport.call("/path/nothing")


def test_what_nodes_do_is_reported_as_diagnostics(hub: Hub, peer: Peer) -> None:
    with hub.running("fps_control"):
        diagnostics = peer.hear("/diagnostics", DiagnosticArray)
        wait_for(lambda: diagnostics, "a report")
    [status] = diagnostics[0].statuses
    assert status.name == "/fps_control"
    assert status.values["received"] == "0"


def test_messages_that_a_middleware_skips_count_as_dropped(
    hub: Hub, peer: Peer, tmp_path: Path
) -> None:
    def skip(subscriber: Any, count: int) -> None:
        subscriber.inbox.dropped += count

    with hub.running("fps_control"), closing(RemoteRuntime(peer.transport)) as viewer:
        images = peer.advertise("/controlled_stream", Image)
        diagnostics = peer.hear("/diagnostics", DiagnosticArray)
        wait_for(lambda: _has_parameters(viewer, "fps_control"), "the node's parameters")
        wait_for(lambda: "/controlled_stream" in viewer.graph.topics, "the topic")
        wait_for(lambda: "/image_raw" in hub.topics, "the node")
        recording = viewer.start_recording(tmp_path / "r.mcap", topics=["/controlled_stream"])
        [recorded] = hub.topics["/controlled_stream"].subscribers
        [taken] = hub.topics["/image_raw"].subscribers
        skip(taken, 5)
        skip(recorded, 7)
        images.publish(IMAGE)
        wait_for(lambda: recording.dropped, "the recording's drops")
        wait_for(lambda: diagnostics and _dropped(diagnostics[-1]), "the node's drops")
    assert recording.dropped == 7
    assert _dropped(diagnostics[-1]) == 5


def _has_parameters(viewer: RemoteRuntime, node: str) -> bool:
    return node in viewer.parameters and bool(vars(viewer.parameters[node].current))


def _dropped(diagnostics: DiagnosticArray) -> int:
    return int(diagnostics.statuses[0].values.get("dropped/queue", 0))


def test_one_refused_image_does_not_hide_the_next_reason(
    hub: Hub, peer: Peer, caplog: pytest.LogCaptureFixture
) -> None:
    with hub.running("filters"):
        diagnostics = peer.hear("/diagnostics", DiagnosticArray)
        images = peer.advertise("/controlled_stream", Image)
        wait_for(lambda: images.connections, "the node")
        refuse = hub.topics["/controlled_stream"].subscribers[0]._refuse
        for why in ("no size", "no size", "no encoding", *(f"fault {n}" for n in range(100))):
            refuse(why)

        def refused() -> str | None:
            return diagnostics and diagnostics[-1].statuses[0].values.get("dropped/damaged")

        assert wait_for(refused, "a report") == "103"
    assert caplog.text.count("no size") == 1
    assert caplog.text.count("no encoding") == 1
    assert len(caplog.records) < 12


def test_a_message_that_cannot_be_sent_is_counted_and_the_node_goes_on(
    hub: Hub, peer: Peer, caplog: pytest.LogCaptureFixture
) -> None:
    with hub.running("filters", ends_with=1):
        images = peer.advertise("/controlled_stream", Image)
        heard = peer.hear("/processed_image", Image)
        wait_for(lambda: images.connections, "the node")
        hub.topics["/controlled_stream"].subscribers[0]._take(  # past what CDR can hold
            Image(IMAGE.data, "mono8", Header(-(10**9), "camera_optical"))
        )
        wait_for(lambda: "message rejected" in caplog.text, "a word about it")
        images.publish(IMAGE)
        wait_for(lambda: heard, "the next image")


def test_static_transforms_of_a_recording_add_up(hub: Hub, peer: Peer, tmp_path: Path) -> None:
    path = tmp_path / "static.mcap"
    topic = TopicType(Transforms.type_name, qos=LATCHED)
    zero, unturned = np.zeros(3), np.array([0.0, 0, 0, 1])
    with closing(open_recorder(str(path), {"/tf_static": topic})) as recorder:
        for number, child in enumerate(("camera", "lidar")):
            header = Header(10**9 * (number + 1), "base_link")
            transform = TransformStamped(child, zero, unturned, header)
            recorder.write("/tf_static", Transforms((transform,)), header.stamp_ns)
    with hub.running("player", path=str(path), rate=0.0, wait_for="tf_static"):
        wait_for(lambda: hub.topics.get("/tf_static"), "the topic")
        heard = peer.hear("/tf_static", Transforms)
        wait_for(lambda: heard and len(heard[-1].transforms) == 2, "both transforms")
    assert [one.child_frame_id for one in heard[-1].transforms] == ["camera", "lidar"]


def test_velocities_drive_a_robot(hub: Hub, peer: Peer) -> None:
    with hub.running("husky", camera=False):
        velocities = peer.advertise("/cmd_vel", Twist)
        odometry = peer.hear("/odom", Odometry)
        wait_for(lambda: velocities.connections, "the robot")

        def drives() -> bool:
            velocities.publish(Twist(np.array([1.0, 0, 0]), np.zeros(3)))
            return bool(odometry) and odometry[-1].position_xyz[0] > 0.1

        wait_for(drives, "the robot to drive")


def test_wrong_usage_is_told_by_the_executables_status(hub: Hub, tmp_path: Path) -> None:
    host = hub.host({"path": str(tmp_path / "nothing.bag")})
    with pytest.raises(SystemExit) as ended:
        run("player", host)
    assert ended.value.code == 2
    assert host.is_over()
    with pytest.raises(OpenError):
        host.find_file("package://nothing/x")


BROKEN = """
from ros_visualise.data import Image
from ros_visualise.nodes import node

@node("broken", inputs={"image": Image}, outputs={})
class Broken:
    def __init__(self, params):
        raise KeyError("lens")

    def step(self, image, params):
        pass
"""


def test_a_node_that_cannot_begin_says_so_in_one_line(
    hub: Hub, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "broken.py").write_text(BROKEN)
    host = hub.host(args=[f"{tmp_path}/broken.py:broken"])
    with pytest.raises(SystemExit) as ended:
        run("node", host)
    assert ended.value.code == 1
    [said] = caplog.records
    where = f"{tmp_path / 'broken.py'}, line 8"
    assert said.getMessage() == f"broken cannot start: KeyError: 'lens' ({where})"
    assert said.exc_info is None


@pytest.mark.parametrize("name", ["filters", "landscape", "player", "viewer"])
def test_node_runs_what_its_argument_names(
    hub: Hub, name: str, caplog: pytest.LogCaptureFixture
) -> None:
    """As the executable of that name does."""
    wrong = {"view": "tv", "path": "/nowhere.bag"}
    for arguments in ([name], ["node", name]):
        host = hub.host(wrong, args=arguments[1:])
        with pytest.raises(SystemExit) as ended:
            run(arguments[0], host)
        assert (ended.value.code, host.name) == (2, f"/{name}")
    [own, other] = caplog.messages
    assert own == other


def test_nothing_is_offered_by_who_has_ended(hub: Hub) -> None:
    with hub.running("path"):
        wait_for(lambda: "/path/clear" in hub.services, "its action")
        assert hub.parameters
    assert not hub.services
    assert not hub.parameters


def test_what_a_recording_tells_of_its_own_graph_is_not_played(
    hub: Hub, peer: Peer, tmp_path: Path
) -> None:
    path, text = tmp_path / "r.mcap", TopicType(Text.type_name)
    topics = ["/said", "/rosout", "/rosout_agg", "/parameter_events"]
    with open_recorder(str(path), dict.fromkeys(topics, text)) as recorder:
        for stamp_ns in range(10**9, 10**9 + 10):
            for topic in topics:
                recorder.write(topic, Text("hello"), stamp_ns)
    with hub.running("player", path=str(path), wait_for="/said"):
        heard = {topic: peer.hear(topic, Text) for topic in topics}
        wait_for(lambda: heard["/said"], "the recording")
        assert set(topics) & set(peer.transport.listing().types) == set(topics)
    assert not any(heard[topic] for topic in topics[1:])


def test_a_video_is_played_for_whoever_subscribes(hub: Hub, peer: Peer, tmp_path: Path) -> None:
    video = write_video(tmp_path / "v.mkv", numbered(5, 64, 48))
    with hub.running("streamer", path=str(video), loop=True):
        heard = peer.hear("/image_raw", Image)
        wait_for(lambda: len(heard) > 5, "images")
    assert {(image.height, image.width, image.encoding) for image in heard} == {(48, 64, "bgr8")}


END = "streamer ended; to play it again, set its parameter paused to false"


def test_a_film_that_has_ended_is_reported_and_can_be_played_again(
    hub: Hub, peer: Peer, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    video = write_video(tmp_path / "v.mkv", numbered(25, 16, 12))
    images = peer.hear("/image_raw", Image)
    given = {"path": str(video), "stay": True, "paused": True}
    with (
        hub.running("streamer", **given),
        closing(RemoteRuntime(HubTransport(hub, name="viewer"))) as viewer,
    ):
        for lap in (1, 2):
            before = len(images)
            wait_for(lambda: _is_paused(viewer, "streamer"), "it to wait")
            viewer.parameters["streamer"].update({"paused": False})
            wait_for(lambda b=before: len(images) - b >= 24, "the images")
            wait_for(lambda n=lap: sum(END in line for line in caplog.messages) == n, "its end")
        wait_for(lambda: viewer.report().nodes["streamer"].ended, "its figures")
        assert any("streamer: ended; to play it" in one for one in lines_of(viewer.report()))


def _is_paused(viewer: RemoteRuntime, node: str) -> bool:
    parameters = viewer.parameters.get(node)
    return parameters is not None and bool(getattr(parameters.current, "paused", False))


def test_a_source_that_breaks_does_not_stay(hub: Hub, tmp_path: Path) -> None:
    path = tmp_path / "cut.mkv"
    with hub.running("streamer", ends_with=2, path=str(path), stay=True) as streamer:
        wait_for(streamer.is_over, "its end")


def test_who_looks_knows_our_own_nodes_and_sees_no_robot_beside_it(
    hub: Hub, tmp_path: Path
) -> None:
    looker = HubTransport(hub, name="uav1/viewer")
    for place in ("", "uav1/", "uav2/"):
        other = HubTransport(hub, name=f"{place}cam")
        other.advertise(f"/{place}image_raw", TopicType(Image.type_name))
    video = write_video(tmp_path / "v.mkv", numbered(5, 64, 48))
    streamer = hub.running("streamer", path=str(video), loop=True)
    with streamer, closing(RemoteRuntime(looker)) as remote:
        find = remote.parameters.get  # it is there before its parameters are
        ours = wait_for(lambda: getattr(find("streamer"), "node", None), "its parameters")
        assert ours.name == "streamer"
        assert {"cam", "uav1/cam"} <= set(remote.parameters)
        assert "uav2/cam" not in remote.parameters


def test_static_frames_of_two_nodes_in_one_process_are_both_there_for_who_comes_late(hub):
    """A latched topic of a process holds its last message alone, whoever of it has published."""
    process, frames = HubTransport(hub, name="process"), StaticFrames()
    for child in ("base", "tag"):
        published = process.advertise("/tf_static", TopicType(Transforms.type_name, qos=LATCHED))
        frame = TransformStamped(child, np.zeros(3), np.array([0.0, 0, 0, 1]), Header(0, "map"))
        StaticTransformsOutput(published, frames).put(Packet(1, Transforms((frame,)), 0))
    (late,) = Peer(hub).hear("/tf_static", Transforms)
    assert {one.child_frame_id for one in late.transforms} == {"base", "tag"}


def test_who_is_asked_to_end_while_it_opens_something_ends(
    hub: Hub, monkeypatch: pytest.MonkeyPatch
) -> None:
    host, opening = hub.host({"path": "large.bag"}), Event()

    def open_long(_: str) -> None:
        host.stop()
        opening.wait(60)

    monkeypatch.setattr("ros_visualise.running.executables.player.open_recording", open_long)
    with pytest.raises(SystemExit) as ended:
        run("player", host)
    assert ended.value.code == 0
    opening.set()


@pytest.mark.parametrize("calibrated", [True, False])
def test_what_comes_while_an_input_subscribes_is_taken(hub: Hub, calibrated: bool) -> None:
    class Eager(HubTransport):
        """Has something for whoever subscribes before that is done."""

        def subscribe(self, topic: str, kind: type, take: Any, refuse: Any) -> Any:
            refuse(f"{topic}: a message that contradicts itself")
            take(CameraInfo(4, 6, np.diag([7.0, 7, 1])) if kind is CameraInfo else IMAGE)
            return super().subscribe(topic, kind, take, refuse)

    taken: list[Image] = []
    name = "/image_raw"
    images = ImageInput(Eager(hub), name, name, taken.append, False, calibrated=calibrated)
    images.open()
    images.close()
    assert images.refused == 1 + calibrated
    [image] = taken
    assert (image.camera_info is not None) == calibrated


@pytest.mark.parametrize("topic", ["/image_raw", "/image_raw/compressed"])
def test_at_rate_0_a_slow_subscriber_gets_every_image(
    hub: Hub, peer: Peer, tmp_path: Path, topic: str
) -> None:
    video = write_video(tmp_path / "v.mkv", numbered(50, 160, 120))
    taken: list[int] = []

    def take(image: Any) -> None:
        sleep(0.01)
        taken.append(image.header.stamp_ns)

    kind = CompressedImage if topic.endswith("compressed") else Image
    peer.transport.subscribe(topic, kind, take, peer.refused.append)
    with hub.running("streamer", path=str(video), rate=0.0):
        wait_for(lambda: len(taken) == 50, "all images")
    assert len(set(taken)) == 50


def test_at_rate_0_a_slow_subscriber_gets_every_other_message(
    hub: Hub, peer: Peer, tmp_path: Path
) -> None:
    path = tmp_path / "odom.mcap"
    pose = Odometry(np.ones(3), np.array([0.0, 0, 0, 1]))
    with closing(open_recorder(str(path), {"/odom": TopicType(Odometry.type_name)})) as recorder:
        for number in range(50):
            recorder.write("/odom", replace(pose, header=Header(10**9 + number, "odom")))
    taken: list[int] = []

    def take(odometry: Odometry) -> None:
        sleep(0.01)
        taken.append(odometry.header.stamp_ns)

    peer.transport.subscribe("/odom", Odometry, take, peer.refused.append)
    with hub.running("player", path=str(path), rate=0.0):
        wait_for(lambda: len(taken) == 50, "all messages")
    assert sorted(taken) == taken


def test_discovery_goes_on_after_what_a_middleware_must_not_raise(hub: Hub) -> None:
    class Odd(HubTransport):
        odd = 0

        def listing(self) -> Any:
            if self.odd:
                self.odd -= 1
                raise KeyError("a reply that nobody expects")
            return super().listing()

    transport = Odd(hub, name="viewer")
    remote = RemoteRuntime(transport)
    transport.odd = 3
    with hub.running("filters", ends_with=1):
        wait_for(lambda: "filters" in remote.parameters, "the node")
    remote.close()
    assert {(one.who, one.kind): n for one, n in PROCESS.failures.items()} == {
        ("discovery", "KeyError"): 3
    }
    PROCESS.forget()


class Unwilling(HubTransport):
    """A middleware that has no messages of one type."""

    def subscribe(self, topic: str, kind: type, *others: Any) -> Any:
        if kind is Odometry:
            raise UsageError("no messages of type nav_msgs/msg/Odometry")
        return super().subscribe(topic, kind, *others)


def test_a_topic_that_cannot_be_subscribed_leaves_neither_a_thread_nor_a_file(
    hub: Hub, peer: Peer, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    poses, images = peer.advertise("/said", Odometry), peer.advertise("/seen", Image)
    with closing(RemoteRuntime(Unwilling(hub, name="viewer"))) as viewer:
        wait_for(lambda: {"/said", "/seen"} <= viewer.graph.topics.keys(), "the topics")
        before = threading.active_count()
        for number in range(5):
            with pytest.raises(UsageError, match="nothing to record: /said: no messages of type"):
                viewer.start_recording(tmp_path / f"{number}.mcap", topics=["/said"])
        assert threading.active_count() == before
        assert not list(tmp_path.iterdir())
        assert not viewer.report().recordings
        recording = viewer.start_recording(tmp_path / "r.mcap", topics=["/said", "/seen"])
        wait_for(lambda: images.connections, "the viewer")
        images.publish(IMAGE)
        poses.publish(Odometry(np.zeros(3), np.array([0.0, 0, 0, 1])))
        wait_for(lambda: recording.written, "the image")
        viewer.stop_recording(recording)
    assert f"{tmp_path / 'r.mcap'}: /said is not recorded: no messages of type" in caplog.text


def test_a_viewer_follows_few_of_the_nodes_that_have_gone(
    hub: Hub, peer: Peer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ros_visualise.runtime.remote.runtime._LOOK_S", 0.01)
    monkeypatch.setattr("ros_visualise.runtime.remote.runtime._REMEMBERED", 3)
    with closing(RemoteRuntime(HubTransport(hub, name="viewer"))) as viewer:
        for number in range(10):
            node = HubTransport(hub, name=f"passing{number}")
            with closing(node.serve_parameters(Parameters(FiltersParams()), "")):
                wait_for(lambda name=f"passing{number}": name in viewer.parameters, "the node")

        def followed() -> set[str]:
            names = {thread.name for thread in threading.enumerate()}
            return {name for name in names if name.startswith("parameters of /passing")}

        wait_for(lambda: len(followed()) <= 3, "the first to be forgotten")
        assert followed() == {f"parameters of /passing{number}" for number in (7, 8, 9)}
        assert set(viewer.parameters) == {"passing7", "passing8", "passing9"}
        with closing(node.serve_parameters(Parameters(FiltersParams()), "")):
            wait_for(lambda: "passing9" in {one.name for one in viewer.graph.nodes}, "its return")
