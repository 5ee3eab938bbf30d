"""The examples that draw and that make images: what they say can be done with them is done."""

import json
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from ports import free_port
from waiting import wait_for

from ros_visualise.data import Odometry, PointCloud
from ros_visualise.data.header import Header
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.graph.pipelines import alone
from ros_visualise.nodes import find
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback

EXAMPLES = Path(__file__).parent.parent / "examples"
NEAREST = f"{EXAMPLES / '04_nearest_obstacle.py'}:nearest"
BALL = f"{EXAMPLES / '05_own_source.py'}:Ball"


@pytest.mark.usefixtures("opengl")
def test_every_scan_is_joined_with_odometry_and_drawn():
    pytest.importorskip("mujoco")
    ros_visualise = Path(sys.executable).parent / "ros-visualise"
    options = ["--view", "none", "--rate", "0", "--duration", "2", "--json", "--node", NEAREST]
    command = [ros_visualise, "sim", "husky", "--world", "playpen", *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode in (0, 130), done.stderr
    report = json.loads(done.stdout)
    assert report["topics"]["/nearest"]["messages"] == report["topics"]["/points"]["messages"] > 10
    assert report["nodes"]["nearest"]["dropped"] == {}


@pytest.mark.parametrize(("speed_mps", "green"), [(0.0, 1), (-2.0, 1), (2.0, 0)])
def test_the_nearest_obstacle_is_red_where_the_robot_will_soon_be(speed_mps, green):
    rows = np.array(
        [(9, 0, 1), (4, 0, 1), (1, 0, 0), (np.nan, 0, 0)],
        [(axis, "f4") for axis in "xyz"],
    )
    declared = find(NEAREST)
    header = Header(5, "base_link")
    odom = Odometry(
        np.zeros(3),
        np.array([0, 0, 0, 1.0]),
        np.array([speed_mps, 0, 0]),
        child_frame_id="base_link",
    )
    markers = declared.make(None).step(
        points=PointCloud(rows, header=header),
        odom=odom,
        params=declared.params(),
        frames=FrameTree(),
    )
    sphere, line = markers.markers
    np.testing.assert_array_equal(sphere.position_xyz, [4, 0, 1])
    np.testing.assert_array_equal(line.points_xyz, [[0, 0, 0], [4, 0, 1]])
    assert sphere.header == header
    assert sphere.color_rgba.tolist() == [1, green, 0, 1]


def test_the_ball_comes_to_rest_and_rises_when_it_is_kicked():
    playback = Playback()
    playback.pause()
    runtime = LocalRuntime(alone(find(BALL)), playback)
    images = runtime.subscribe("/image_raw")
    runtime.start()
    wait_for(lambda: images.take(1), "the first image")

    def next_heights(count):
        for _ in range(count):
            playback.step()
            yield height(wait_for(lambda: images.take(1), "the next image"))

    falling = list(next_heights(250))
    assert max(falling[:10]) > 100
    assert falling[-20:] == [0] * 20
    runtime.act("ball", "kick")
    assert max(next_heights(20)) > 50
    runtime.stop()
    assert not runtime.failed


def height(image):
    """Pixels between the ball and the ground."""
    rows = np.flatnonzero(image.pixels.any(axis=1))
    return round(0.9 * 320) - round((rows[0] + rows[-1]) / 2)


def test_the_example_of_a_source_shows_its_page_until_ctrl_c():
    port = free_port()
    command = [sys.executable, EXAMPLES / "21_own_page.py", str(port)]
    shown = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        address = next(line for line in shown.stderr if line.startswith("open ")).split()[1]
        assert address.startswith(f"http://127.0.0.1:{port}/")
        wait_for(lambda: answers(address), address, process=shown)
        shown.send_signal(signal.SIGINT)
        said = shown.communicate(timeout=60)[1]
    finally:
        shown.kill()
    assert (shown.returncode, "Traceback" in said) == (0, False), said


def answers(address):
    try:
        with urllib.request.urlopen(address, timeout=5) as page:
            return page.status == 200
    except OSError:
        return False
