"""Pipelines on one machine, and who looks at them on another one."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from machines import Machine, two_machines
from mcap.reader import make_reader
from waiting import wait_for

from ros_visualise.messages.definitions import Definitions
from ros_visualise.running.network import join
from ros_visualise.running.options import NetworkOptions

PLAYED = "demo", "landscape", "--view", "none"
LIMIT_S = 90  # which is no more than a bound on hanging

FETCH = """
import sys, time, urllib.request
for _ in range(300):
    try:
        print(urllib.request.urlopen("http://127.0.0.1:8080/", timeout=5).status)
        break
    except OSError:
        time.sleep(0.2)
"""


@pytest.fixture
def machines() -> Iterator[tuple[Machine, Machine]]:
    with two_machines() as made:
        yield made


def end(process: subprocess.Popen[str]) -> tuple[int, str]:
    """End a command by Ctrl-C; its exit status, and what it printed on standard error."""
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=LIMIT_S)
    return process.returncode, said


def images(path: Path, topic: str) -> list[Any]:
    """The images of a recording."""
    definitions = Definitions("cdr")
    with path.open("rb") as stream:
        messages = make_reader(stream).iter_messages([topic])
        return [definitions.read("sensor_msgs/msg/Image", one.data) for _, _, one in messages]


def test_a_page_on_one_machine_shows_and_sets_nodes_on_another(
    machines: tuple[Machine, Machine], tmp_path: Path
) -> None:
    robot, laptop = machines
    path = tmp_path / "seen.mcap"
    nodes = robot.start(*PLAYED, "--listen", f"tcp/{robot.address}:7447")
    record = "--record", f"{path}@/processed_image"
    settings = [f"pipeline/filters.{one}" for one in ("gray=false", "threshold_mode=off")]
    there = "--connect", f"tcp/{robot.address}:7447", "--no-token", *record
    page = laptop.start("view", *there, *(text for one in settings for text in ("--set", one)))
    fetched, _ = laptop.run([sys.executable, "-c", FETCH]).communicate(timeout=LIMIT_S)
    assert fetched.strip() == "200"
    wait_for(path.exists, "the recording")
    other = laptop.start("view", "--view", "none", *there[:2], "--duration", "6", "--json")
    report, _ = other.communicate(timeout=LIMIT_S)
    assert '"pipeline/filters"' in report
    status, said = end(page)
    assert (status, "Traceback" in said) == (130, False), said
    status, said = end(nodes)
    assert (status, "Traceback" in said) == (130, False), said
    seen = images(path, "/processed_image")
    assert {image.encoding for image in seen} >= {"bgr8"}
    assert len({(one.header.stamp.sec, one.header.stamp.nanosec) for one in seen}) == len(seen) > 10


def test_a_peer_that_is_lost_is_reported_once_and_comes_back(
    machines: tuple[Machine, Machine], tmp_path: Path
) -> None:
    robot, laptop = machines
    path = tmp_path / "seen.mcap"
    listening = "--listen", f"tcp/{robot.address}:7447"
    first = robot.start(*PLAYED, *listening)
    record = "--record", f"{path}@/edges"
    there = "--connect", f"tcp/{robot.address}:7447"
    viewer = laptop.start("view", "--view", "none", *there, *record)
    wait_for(path.exists, "the recording")
    first.kill()
    first.wait()
    second = robot.start(*PLAYED, *listening)
    assert viewer.stderr
    said = ""
    while "connected to" not in said:
        line = viewer.stderr.readline()
        assert line, said
        said += line
    size = path.stat().st_size
    wait_for(lambda: path.stat().st_size > size + 200_000, "images again")
    viewer.send_signal(signal.SIGINT)
    said += viewer.stderr.read()
    assert viewer.wait(LIMIT_S) == 130
    assert said.count("lost the connection") == said.count("connected to") == 1, said
    assert end(second)[0] == 130
    assert images(path, "/edges")


def test_nothing_listens_unless_asked() -> None:
    assert join(NetworkOptions(), "pipeline") is None


@pytest.mark.parametrize(
    "wrong", [("--connect", "nowhere"), ("--connect", "tcp/a:1", "--listen", "tcp/b:1")]
)
def test_an_address_that_is_none_is_wrong_usage(wrong: tuple[str, ...]) -> None:
    command = [sys.executable, "-m", "ros_visualise", "view", *wrong]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)
    assert done.returncode == 2
    [line] = done.stderr.splitlines()
    assert "address" in line
