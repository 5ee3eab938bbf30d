"""Recordings of calibrated images hold the calibration as ROS does, and play again with it."""

from pathlib import Path

import numpy as np
import pytest
from made_videos import numbered, write_video
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from ros_visualise.data import CameraInfo, Header, Image
from ros_visualise.graph import Graph, SourceNode
from ros_visualise.graph.pipelines import image_pipeline, recording_pipeline
from ros_visualise.nodes import NoParams, source
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.report import RecordingReport
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback

FRAMES = 5
IMAGES = ("/image_raw", "/controlled_stream", "/processed_image", "/edges")
INFOS = {"/image_raw": "/camera_info"} | {name: f"{name}/camera_info" for name in IMAGES[1:]}
HALVED = {"/image_raw": 20, "/controlled_stream": 20, "/processed_image": 10, "/edges": 10}
CALIBRATION = """\
image_width: 32
image_height: 24
distortion_model: plumb_bob
camera_matrix: {rows: 3, cols: 3, data: [20, 0, 15.5, 0, 21, 11.5, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0.2, 0.3, 0.4, 0.5]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [19, 0, 15, 0, 0, 20, 11, 0, 0, 0, 1, 0]}
"""


@pytest.fixture
def video(tmp_path):
    """Source and settings of a calibrated video of 32x24, which the filters halve."""
    write_video(tmp_path / "v.mkv", numbered(FRAMES))
    (tmp_path / "ost.yaml").write_text(CALIBRATION)
    known = {"path": str(tmp_path / "v.mkv"), "camera_info_url": str(tmp_path / "ost.yaml")}
    return image_pipeline("streamer", **known).configured({"filters": {"scale": 0.5}})


def record(graph, *targets, topics=()):
    """Run it to its end as fast as it goes; the messages that were recorded, and the report."""
    runtime = LocalRuntime(graph, Playback(rate=0))
    for target in targets:
        runtime.start_recording(target, topics=topics)
    runtime.start()
    assert runtime.wait(60)
    runtime.stop()
    assert not runtime.failed
    return runtime.report().recordings


def read(path):
    """Topic -> (time, message) as the rosbags library reads it."""
    found: dict[str, list] = {}
    is_ros1 = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    with AnyReader([path], default_typestore=store) as reader:
        for connection, stamp_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append((stamp_ns, message))
    return found


def play_again(path, topic):
    recording = open_recording(path)
    try:
        return [entry.message.content for entry in recording.read(topics=[topic])]
    finally:
        recording.close()


def topics_of(path):
    recording = open_recording(path)
    try:
        return {name: info.messages for name, info in recording.topics.items()}
    finally:
        recording.close()


@pytest.mark.parametrize("name", ["r.bag", "r.mcap", "folder"])
def test_beside_each_image_is_its_calibration(video, tmp_path, name):
    written = record(video, path := tmp_path / name)
    assert written[str(path)].messages == 2 * FRAMES * len(IMAGES)
    found = read(path)
    for topic, info in INFOS.items():
        assert len(found[info]) == FRAMES
        for (stamp_ns, image), (info_ns, said) in zip(found[topic], found[info], strict=True):
            ros1 = name == "r.bag"
            K, D, P = (said.K, said.D, said.P) if ros1 else (said.k, said.d, said.p)
            part = HALVED[topic] / 20
            assert stamp_ns == info_ns
            assert said.header == image.header
            assert said.header.frame_id == "camera_optical"
            assert (said.width, said.height) == (image.width, image.height)
            np.testing.assert_allclose([K[0], K[4], P[0], P[5]], np.array([20, 21, 19, 20]) * part)
            np.testing.assert_array_equal(D, [0.1, 0.2, 0.3, 0.4, 0.5])


@pytest.mark.parametrize("name", ["r.bag", "r.mcap", "folder"])
def test_played_again_the_images_have_it(video, tmp_path, name):
    record(video, tmp_path / name)
    for topic in IMAGES:
        images = play_again(tmp_path / name, topic)
        assert len(images) == FRAMES
        for image in images:
            info = image.camera_info
            assert info.K[0, 0] == HALVED[topic]
            assert info.header == image.header
            assert (info.width, info.height) == (image.width, image.height)


def test_the_same_run_makes_the_same_files(video, tmp_path):
    names = ("r.bag", "r.mcap")
    for folder in (tmp_path / "a", tmp_path / "b"):
        folder.mkdir()
        record(video, *(folder / name for name in names))
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_without_a_calibration_there_is_no_topic_of_it(tmp_path):
    write_video(tmp_path / "v.mkv", numbered(FRAMES))
    graph = image_pipeline("streamer", path=str(tmp_path / "v.mkv"))
    record(graph, tmp_path / "r.bag", tmp_path / "r.mcap")
    assert topics_of(tmp_path / "r.bag").keys() == set(IMAGES)
    assert topics_of(tmp_path / "r.mcap").keys() == {*IMAGES, "/parameter_events"}


@pytest.mark.parametrize("topic", IMAGES)
def test_images_that_are_chosen_bring_theirs_along(video, tmp_path, topic):
    record(video, tmp_path / "r.bag", topics=[topic])
    assert topics_of(tmp_path / "r.bag") == {topic: FRAMES, INFOS[topic]: FRAMES}


def test_a_video_holds_images_alone(video, tmp_path):
    written = record(video, tmp_path / "r.mp4")
    assert written == {str(tmp_path / "r.mp4"): RecordingReport(FRAMES, dropped=0)}


@pytest.fixture
def recorded(video, tmp_path):
    """A bag of the run."""
    record(video, tmp_path / "first.bag")
    return tmp_path / "first.bag"


def graph_of(path: Path, *topics, **choice) -> Graph:
    return recording_pipeline(open_recording(path), topics, **choice)


def test_what_a_recording_has_of_its_own_is_recorded_once(recorded, tmp_path):
    graph = graph_of(recorded, image="/image_raw").configured({"filters": {"scale": 0.25}})
    record(graph, tmp_path / "r.bag")
    before = {INFOS[name]: f"/recorded{INFOS[name]}" for name in IMAGES[1:]}
    there = {name: f"/recorded{name}" for name in IMAGES[1:]}
    expected = {*IMAGES, *INFOS.values(), *before.values(), *there.values()}
    assert topics_of(tmp_path / "r.bag") == dict.fromkeys(expected, FRAMES)
    for topic, focal_length in {"/edges": 5, "/recorded/edges": 10, "/image_raw": 20}.items():
        for image in play_again(tmp_path / "r.bag", topic):
            assert image.camera_info.K[0, 0] == focal_length


def test_chosen_images_of_a_recording_bring_its_calibration_along(recorded, tmp_path):
    record(graph_of(recorded, image=""), tmp_path / "r.bag", topics=["/processed_image"])
    there = topics_of(tmp_path / "r.bag")
    assert there == dict.fromkeys(["/processed_image", "/processed_image/camera_info"], FRAMES)


def test_so_do_images_that_are_played_without_it(recorded, tmp_path):
    record(graph_of(recorded, "/edges", image=""), tmp_path / "r.bag")
    assert topics_of(tmp_path / "r.bag") == {"/edges": FRAMES, "/edges/camera_info": FRAMES}
    first, again = (
        [(stamp_ns, said.header.frame_id, said.K.tolist()) for stamp_ns, said in found]
        for found in (read(path)["/edges/camera_info"] for path in (recorded, tmp_path / "r.bag"))
    )
    assert first == again


@pytest.mark.parametrize("name", ["r.bag", "r.mcap"])
def test_where_a_calibration_ends_the_camera_is_said_to_have_none(tmp_path, name):
    @source("changing", params=NoParams, outputs={"image": Image})
    class Changing:
        def __init__(self, params, playback):
            pass

        def messages(self):
            info = CameraInfo(2, 3, np.diag([5.0, 5.0, 1.0]))
            for number, known in enumerate([None, info, None]):
                pixels = np.zeros((2, 3), np.uint8)
                yield "image", Image(pixels, "mono8", Header(number + 1, "cam"), known)

        def close(self):
            pass

    changing = SourceNode("changing", Changing.declared, NoParams(), {}, {"image": "/left"})
    record(Graph(changing, ()), tmp_path / name)
    said = [
        (ns, m.header.frame_id, m.width) for ns, m in read(tmp_path / name)["/left/camera_info"]
    ]
    assert said == [(2, "cam", 3), (3, "cam", 3)]
    infos = [image.camera_info for image in play_again(tmp_path / name, "/left")]
    assert [info.K[0, 0] for info in infos[1:]] == [5, 0]


@pytest.mark.usefixtures("opengl")
def test_a_simulated_robots_camera_is_calibrated(tmp_path):
    pytest.importorskip("mujoco")
    from ros_visualise.graph.pipelines import simulation_pipeline

    small = {"camera_width": 64, "camera_height": 48, "lidar": False, "world": "plane"}
    graph = simulation_pipeline("husky", mission="square", **small)
    runtime = LocalRuntime(graph, Playback(rate=0, duration_s=0.5))
    runtime.start_recording(tmp_path / "r.mcap")
    runtime.start()
    assert runtime.wait(60)
    runtime.stop()
    found = read(tmp_path / "r.mcap")
    assert len(found["/image_raw"]) > 2
    for (_, image), (_, info) in zip(found["/image_raw"], found["/camera_info"], strict=True):
        assert info.header == image.header
        assert (info.width, info.height, info.k[2], info.k[5]) == (64, 48, 31.5, 23.5)
    for image in play_again(tmp_path / "r.mcap", "/edges"):
        assert image.camera_info.K[0, 0] == found["/camera_info"][0][1].k[0]
