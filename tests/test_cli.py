"""The command line as a person meets it: a process, its outputs, its exit status."""

import json
import os
import signal
import socket
import subprocess
import sys
import time

import av
import forked
import numpy as np
import pytest
from waiting import bytes_in, wait_for

from ros_visualise.nodes import find

COMMAND = [sys.executable, "-m", "ros_visualise"]
QUICK = ["--view", "none", "--rate", "0"]


def run(*arguments, **options):
    return forked.run([*COMMAND, *arguments], timeout=60, **options)


def refused(*arguments):
    """The one line with which a call is refused."""
    done = run(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    [line] = done.stderr.splitlines()
    return line


def write_video(path, frames=30, size=(64, 48), fps=30):
    with av.open(str(path), "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=fps)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        for number in range(frames):
            pixels = np.full((size[1], size[0], 3), number * 7 % 256, np.uint8)
            pixels[:, : number % size[0]] = 255
            container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, "rgb24")))
        container.mux(stream.encode())
    return path


@pytest.fixture(scope="session")
def video(tmp_path_factory):
    return write_video(tmp_path_factory.mktemp("videos") / "2021-ü ber.mp4")


def test_a_video_runs_to_its_end_and_reports(video):
    done = run("video", video, *QUICK, "--json", "--set", "fps_control.fps=15")
    assert done.returncode == 0
    report = json.loads(done.stdout)
    assert report["topics"]["/image_raw"]["messages"] == 30
    assert report["topics"]["/edges"]["type"] == "sensor_msgs/msg/Image"
    assert report["topics"]["/edges"]["messages"] == 15
    assert report["topics"]["/edges"]["hz"] == pytest.approx(15, rel=0.01)
    assert report["nodes"]["fps_control"]["requested_hz"] == 15
    assert report["nodes"]["fps_control"]["dropped"] == {"rate": 15}
    assert "/edges_overlay" not in report["topics"]


def test_the_real_drone_video(recordings):
    path = recordings / "video" / "gopro_karma_drone.mp4"
    done = run("video", path, *QUICK, "--json", "--set", "fps_control.enabled=false")
    assert done.returncode == 0
    report = json.loads(done.stdout)
    topics = report["topics"].values()
    images = [topic["messages"] for topic in topics if topic["type"] == "sensor_msgs/msg/Image"]
    assert images == [362] * 4
    assert report["topics"]["/fix"]["messages"] == 47
    assert report["topics"]["/edges"]["hz"] == pytest.approx(29.97, abs=0.01)


def test_demo_frames_and_size():
    done = run("demo", "landscape", *QUICK, "--json", "--frames", 12, "--size", "100x80")
    assert done.returncode == 0
    assert json.loads(done.stdout)["topics"]["/edges"]["messages"] == 12


def test_start_and_duration(video):
    done = run("video", video, *QUICK, "--json", "--start", 0.5, "--duration", 0.2)
    assert json.loads(done.stdout)["topics"]["/image_raw"]["messages"] == 6


def test_loop_until_so_many_frames(video):
    done = run("video", video, *QUICK, "--json", "--loop", "--frames", 75)
    report = json.loads(done.stdout)
    assert report["topics"]["/image_raw"]["messages"] == 75
    assert report["topics"]["/image_raw"]["hz"] == pytest.approx(30, rel=0.01)


def test_recordings_are_the_same_each_time(video, tmp_path):
    for name in ("a.mcap", "b.mcap"):
        assert run("video", video, *QUICK, "--record", tmp_path / name).returncode == 0
    recorded = (tmp_path / "a.mcap").read_bytes()
    assert recorded == (tmp_path / "b.mcap").read_bytes()
    assert len(recorded) > 1000


def test_a_recorded_video_plays_again(video, tmp_path):
    out = tmp_path / "edges.mp4"
    assert run("video", video, *QUICK, "--record", out).returncode == 0
    assert out.stat().st_size > 0
    done = run("video", out, *QUICK, "--json")
    assert json.loads(done.stdout)["topics"]["/image_raw"]["messages"] == 30


def test_a_recording_that_exists_is_kept_unless_told_otherwise(video, tmp_path):
    out = tmp_path / "out.mcap"
    out.write_text("precious")
    assert "exists" in refused("video", video, *QUICK, "--record", out)
    assert out.read_text() == "precious"
    assert run("video", video, *QUICK, "--record", out, "--overwrite").returncode == 0
    assert out.read_bytes().startswith(b"\x89MCAP")


def test_parameters_from_a_file_and_then_from_the_line(video, tmp_path):
    params = tmp_path / "params.yaml"
    params.write_text("fps_control: {fps: 5}\nedge_detector:\n  low: 10\n")
    done = run("video", video, *QUICK, "--json", "--params", params)
    assert json.loads(done.stdout)["nodes"]["fps_control"]["requested_hz"] == 5
    more = ["--set", "fps_control.fps=10"]
    done = run("video", video, *QUICK, "--json", "--params", params, *more)
    assert json.loads(done.stdout)["nodes"]["fps_control"]["requested_hz"] == 10


def test_a_node_of_ones_own(video, request):
    example = request.config.rootpath / "examples" / "01_own_filter.py"
    own = ["--node", f"{example}:posterize", "--set", "posterize.levels=3"]
    halved = ["--set", "fps_control.fps=15"]
    report = json.loads(run("video", video, *QUICK, "--json", *own).stdout)
    assert report["topics"]["/posterize"]["messages"] == 30
    assert report["nodes"]["posterize"]["processed"] == 30
    own[1] += "@streamer"
    report = json.loads(run("video", video, *QUICK, "--json", *own, *halved).stdout)
    assert report["nodes"]["posterize"]["processed"] == 30, "it comes before fps_control"
    assert report["nodes"]["filters"]["processed"] == 15
    assert "from 2 to 32" in refused("video", video, *own[:2], "--set", "posterize.levels=1")


def test_images_are_rectified_behind_their_source(video, tmp_path):
    side = "data: [20, 0, 15.5, 0, 20, 11.5, 0, 0, 1]"
    (tmp_path / "ost.yaml").write_text(
        f"image_width: 32\nimage_height: 24\ncamera_matrix: {{rows: 3, cols: 3, {side}}}\n"
        "distortion_coefficients: {rows: 1, cols: 4, data: [-0.2, 0.1, 0, 0]}\n"
        "rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}\n"
        "projection_matrix: {rows: 3, cols: 4, data: [9, 0, 15, 0, 0, 9, 11, 0, 0, 0, 1, 0]}\n"
    )
    out = tmp_path / "out.mcap"
    behind = ["--node", "rectify@streamer", "--json"]
    known = ["--set", f"streamer.camera_info_url={tmp_path / 'ost.yaml'}"]
    done = run("video", video, *QUICK, *behind, *known, "--record", f"{out}@/image_rect")
    assert json.loads(done.stdout)["nodes"]["edge_detector"]["processed"] == 30
    recorded = json.loads(run("info", out, "--json").stdout)["topics"]
    assert recorded["/image_rect/camera_info"]["messages"] == 30
    done = run("video", video, *QUICK, *behind)
    assert json.loads(done.stdout)["nodes"]["rectify"]["dropped"] == {"uncalibrated": 30}
    assert done.stderr.count("have no calibration") == 1


def test_the_example_from_python_runs(video, request):
    example = request.config.rootpath / "examples" / "02_from_python.py"
    done = subprocess.run(
        [sys.executable, example, video], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.startswith("  0 s: ")


def test_info_of_a_video(video):
    done = run("info", video, "--json")
    about = json.loads(done.stdout)
    assert (about["width"], about["height"], about["fps"]) == (64, 48, 30)
    assert (about["messages"], about["codec"], about["duration"]) == (30, "h264", 1.0)
    assert about["size"] == video.stat().st_size
    text = run("info", video)
    assert text.returncode == 0
    assert "/image_raw" in text.stdout


def test_nodes_lists_every_parameter_with_its_range():
    nodes = json.loads(run("nodes", "--json").stdout)
    assert {
        "streamer",
        "camera",
        "husky",
        "quadrotor",
        "landscape",
        "player",
        "path",
        "fps_control",
        "filters",
        "edge_detector",
    } <= set(nodes)
    low = nodes["edge_detector"]["params"]["low"]
    assert (low["type"], low["default"], low["min"], low["max"]) == ("int", 100, 0, 800)
    assert nodes["fps_control"]["outputs"] == {"image": "sensor_msgs/msg/Image"}
    assert nodes["path"]["actions"] == {"clear": find("path").actions["clear"]}
    text = run("nodes")
    assert text.returncode == 0
    assert "int 0 to 800" in text.stdout
    assert "int 0 to 2147483647" in text.stdout
    assert f"  actions: clear ({find('path').actions['clear']})" in text.stdout


@pytest.mark.parametrize("name", ["", ".ext", " with space.mp4", "ümlaut.mp4", "2021-x.mp4", "a:b"])
def test_a_video_plays_whatever_its_name(video, tmp_path, name):
    path = tmp_path / f"clip{name}" if name.startswith(".") else tmp_path / (name or "bare")
    path.write_bytes(video.read_bytes())
    done = run("video", path, *QUICK, "--json")
    assert json.loads(done.stdout)["topics"]["/edges"]["messages"] == 30


@pytest.mark.parametrize("size", [(1, 1), (2, 2), (33, 17)])
def test_any_size_plays(tmp_path, size):
    width, height = size
    path = tmp_path / "small.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=10)
        stream.width, stream.height, stream.pix_fmt = width, height, "bgr0"
        for _ in range(3):
            pixels = np.full((height, width, 3), 90, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, "bgr24")))
        container.mux(stream.encode())
    done = run("video", path, *QUICK, "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout)["topics"]["/edges"]["messages"] == 3


class TestRefusals:
    """Each is one line that says what to do next, and status 2."""

    def test_inputs(self, tmp_path):
        (tmp_path / "empty.mp4").touch()
        (tmp_path / "text.mp4").write_text("not a video\n" * 100)
        for name in ("missing.mp4", "", "empty.mp4", "text.mp4"):
            assert str(tmp_path / name) in refused("video", tmp_path / name, *QUICK)
            assert str(tmp_path / name) in refused("info", tmp_path / name)

    def test_settings(self, video):
        says = {
            "fps_control.fps=999": "from 0 to 240",
            "fps_control.speed=1": "choose from fps, enabled",
            "nothing.fps=1": "choose from streamer, fps_control, filters, edge_detector",
            "fps=1": "NODE.PARAM=VALUE; did you mean fps_control.fps?",
            "fps_control.enabled=maybe": "true or false",
        }
        for setting, expected in says.items():
            assert expected in refused("video", video, *QUICK, "--set", setting)

    def test_params_files(self, video, tmp_path):
        path = tmp_path / "params.yaml"
        assert "params.yaml: no such file; give a YAML file" in refused(
            "video", video, "--params", path
        )
        for text in ("a: [", "- 1", "fps_control: 3", "fps_control: {fps: }", "\0"):
            path.write_text(text)
            assert str(path) in refused("video", video, "--params", path)

    def test_a_calibration_that_is_not_there(self, video):
        url = ["--set", "streamer.camera_info_url=nowhere.yaml"]
        assert "nowhere.yaml: no such file" in refused("video", video, *url)

    def test_nodes_of_ones_own(self, video):
        assert "FILE.py:NAME" in refused("video", video, "--node", "nonsense")
        assert "no such file" in refused("video", video, "--node", "missing.py:name")

    def test_recordings(self, video, tmp_path):
        record = ["video", video, *QUICK, "--record"]
        assert ".mcap" in refused(*record, tmp_path / "out.xyz")
        assert "no such folder" in refused(*record, tmp_path / "nowhere" / "out.mcap")
        assert "choose from /image_raw" in refused(*record, f"{tmp_path / 'out.mcap'}@/nothing")

    def test_numbers(self, video):
        for option, value in {
            "--rate": "1000",
            "--frames": "0",
            "--duration": "0",
            "--port": "0",
            "--start": "x",
        }.items():
            line = refused("video", video, option, value)
            assert option in line
            assert "is not a" in line

    def test_sizes(self, video):
        assert "640x480" in refused("video", video, *QUICK, "--size", "big")

    def test_a_start_after_the_end(self, video):
        assert "lasts only 1.00 s" in refused("video", video, *QUICK, "--start", 5)

    def test_commands(self):
        assert "demo" in refused("play")

    def test_a_camera_that_is_not_there(self):
        line = refused("camera", "/dev/video77", *QUICK[:2])
        assert "/dev/video77" in line

    def test_a_camera_does_not_rewind(self):
        assert "live" in refused("camera", "test", "--loop")

    def test_a_port_in_use(self, video):
        with socket.create_server(("127.0.0.1", 0)) as server:
            port = server.getsockname()[1]
            line = refused("video", video, "--port", port)
        assert str(port) in line
        assert "--port" in line


def interrupt(process, limit_s=15.0):
    """Press Ctrl-C; the exit status and standard error."""
    started = time.monotonic()
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=20)
    assert time.monotonic() - started < limit_s, errors
    return process.returncode, output, errors


def start(*arguments):
    return forked.Forked(
        [*COMMAND, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )


def test_ctrl_c_while_recording_leaves_readable_files(recordings, tmp_path):
    path = recordings / "video" / "DERIVED_4k_pan_dji0020.mp4"
    mcap, mp4 = tmp_path / "out.mcap", tmp_path / "out.mp4"
    process = start(
        "video", path, "--view", "none", "--loop", "--json", "--record", mcap, "--record", mp4
    )
    wait_for(lambda: bytes_in(mcap) > 50_000_000, "images", process=process)
    status, output, errors = interrupt(process)
    assert status == 130
    assert "Traceback" not in errors
    counts = json.loads(output)["recordings"]
    with av.open(str(mp4)) as container:
        assert sum(1 for _ in container.decode(video=0)) == counts[str(mp4)]["messages"] > 0
    from mcap.reader import make_reader

    with mcap.open("rb") as stream:
        images = sum(
            channel.topic != "/parameter_events"
            for _, channel, _ in make_reader(stream).iter_messages()
        )
    assert images == counts[str(mcap)]["messages"] > 0


def test_two_nodes_of_ones_own_stand_in_the_order_of_the_line(video, tmp_path):
    own = tmp_path / "own.py"
    own.write_text(
        "from ros_visualise.data import Image\n"
        "from ros_visualise.nodes import node\n"
        "def passing(name):\n"
        "    @node(name, inputs={'image': Image}, outputs={'image': Image})\n"
        "    def pass_on(image, params):\n"
        "        return image\n"
        "    return pass_on\n"
        "first, second = passing('first'), passing('second')\n"
    )
    done = run(
        "video", video, *QUICK, "--json", "--node", f"{own}:first", "--node", f"{own}:second"
    )
    nodes = list(json.loads(done.stdout)["nodes"])
    assert nodes == ["streamer", "fps_control", "filters", "first", "second", "edge_detector"]


def test_a_node_comes_after_the_last_that_passes_images_on(video, tmp_path):
    own = tmp_path / "own.py"
    own.write_text(
        "from ros_visualise.data import Image\n"
        "from ros_visualise.nodes import node\n"
        "@node('sink', inputs={'image': Image}, outputs={})\n"
        "def sink(image, params):\n"
        "    return None\n"
        "@node('passing', inputs={'image': Image}, outputs={'image': Image})\n"
        "def passing(image, params):\n"
        "    return image\n"
    )
    sink = ["--node", f"{own}:sink"]
    done = run("video", video, *QUICK, "--json", *sink, "--node", f"{own}:passing")
    assert json.loads(done.stdout)["topics"]["/passing"]["messages"] > 0
    said = refused("video", video, *QUICK, *sink, "--node", f"{own}:passing@sink")
    assert "passing: sink publishes nothing; choose another @AFTER" in said


def test_recordings_are_all_opened_or_none(video, tmp_path):
    (tmp_path / "b.mcap").touch()
    targets = ["--record", tmp_path / "a.mcap", "--record", tmp_path / "b.mcap"]
    assert "exists" in refused("video", video, *QUICK, *targets)
    assert not (tmp_path / "a.mcap").exists()


def test_the_input_is_never_recorded_over(video, tmp_path):
    link = tmp_path / "link.mp4"
    link.hardlink_to(video)
    assert "in use" in refused("video", video, *QUICK, "--record", link, "--overwrite")
    assert link.read_bytes() == video.read_bytes()


def test_the_example_with_a_memory(video, request):
    example = request.config.rootpath / "examples" / "03_frame_difference.py"
    own = ["--node", f"{example}:FrameDifference@fps_control", "--set", "difference.show=mask"]
    report = json.loads(run("video", video, *QUICK, "--json", *own).stdout)
    assert report["topics"]["/difference"]["messages"] == 29


def test_what_comes_after_two_dashes_is_a_file_whatever_it_is_called(tmp_path):
    write_video(tmp_path / "--odd.mp4", frames=3)
    done = run("video", *QUICK, "--json", "--", "--odd.mp4", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["topics"]["/image_raw"]["messages"] == 3
    assert "no such file" in refused("video", *QUICK, "--", "--other")


def test_a_recording_is_split_beside_its_name(video, tmp_path):
    done = run("video", video, *QUICK, "--record", tmp_path / "r.bag", "--split", "64K", "--json")
    assert done.returncode == 0, done.stderr
    parts = sorted(tmp_path.glob("r_*.bag"))
    assert len(parts) > 1
    assert not (tmp_path / "r.bag").exists()
    [recorded] = json.loads(done.stdout)["recordings"].values()
    assert recorded["files"] == len(parts)
    again = ["video", video, *QUICK, "--record", tmp_path / "r.bag", "--split", "64K"]
    assert "r_0.bag exists" in refused(*again)
    assert "needs --record" in refused("video", video, *QUICK, "--split", "1G")
    assert "1x: give a size such as 1G" in refused(*again[:-1], "1x")
    whole = [*QUICK, "--record", tmp_path / "r.bag", "--split", "64K", "--overwrite"]
    assert "in use as the source" in refused("bag", parts[0], *whole)
