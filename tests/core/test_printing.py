"""Names from files of strangers are shown in a terminal, never obeyed."""

import logging
import subprocess
import sys

import forked
import numpy as np
import pytest
from rosbags.rosbag1 import Writer

from ros_visualise.core.printing import EscapingFormatter, escaped, without_secrets
from ros_visualise.data import Header, Odometry
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder

COMMAND = [sys.executable, "-m", "ros_visualise"]
EVIL = "\x1b]0;owned\x07\x1b[2J\x9b31m\r\n\u202egab\u2028"
SHOWN = r"\x1b]0;owned\x07\x1b[2J\x9b31m\r\n\u202egab\u2028"


def run(*arguments):
    """Exit status, and both outputs, in which there is nothing that a terminal would obey."""
    done = forked.run([*COMMAND, *arguments], timeout=60, cwd="/", text=False)
    text = (done.stdout + done.stderr).decode()
    assert text.replace("\n", "").isprintable(), ascii(text)
    return done.returncode, text


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("evil") / f"of{EVIL}"
    made.mkdir()
    return made


@pytest.fixture(scope="module")
def bag(folder, tmp_path_factory):
    """Odometry, and a type that nobody knows; wherever a text is, an evil one."""
    path = tmp_path_factory.mktemp("plain") / "evil.mcap"  # which is no name to record to
    header = [Header(number, f"map{EVIL}") for number in range(3)]
    with open_recorder(str(path), {f"/odom{EVIL}": TopicType("nav_msgs/msg/Odometry")}) as recorder:
        for one in header:
            odometry = Odometry(np.zeros(3), np.array([0, 0, 0, 1.0]), header=one)
            recorder.write(f"/odom{EVIL}", odometry)
    return path.rename(folder / path.name)


@pytest.fixture(scope="module")
def unknown(folder):
    """A ROS 1 bag of a type that cannot be written as ROS 2 has it."""
    path = folder / "unknown.bag"
    with Writer(path) as writer:
        for name in ("/a", f"/b{EVIL}"):
            definition = "void_type wrong"
            kind = f"nobody/msg/Knows{EVIL}"
            connection = writer.add_connection(name, kind, msgdef=definition, md5sum="*")
            writer.write(connection, 1, b"abcd")
    return path


def test_escapes_are_idempotent_and_leave_letters_alone():
    assert escaped(EVIL) == escaped(escaped(EVIL)) == SHOWN
    assert escaped("\udcff") == r"\udcff"
    assert escaped("C:\\tmp\\größe 日本 ½°") == "C:\\tmp\\größe 日本 ½°"


def test_info_shows_names_in_straight_columns(bag, unknown):
    status, text = run("info", bag)
    assert status == 0
    assert f"/odom{SHOWN}" in text
    status, text = run("info", unknown)
    assert f"/b{SHOWN}" in text
    rows = [line for line in text.splitlines() if " @ " in line]
    assert len(rows) == 2
    assert len({row.index(" @ ") for row in rows}) == 1
    assert len({row.index(" : ") for row in rows}) == 1


def test_what_playing_says_is_shown(bag):
    status, text = run("bag", bag, "--view", "none", "--rate", "0")
    assert status == 0
    assert f"/odom{SHOWN}: 3 messages" in text


def test_what_converting_says_is_shown(unknown, folder):
    _, text = run("convert", unknown, folder / "out.mcap")
    assert SHOWN in text


def test_what_a_trajectory_says_is_shown(bag, tmp_path):
    picture = tmp_path / "picture.svg"
    status, text = run("trajectory", bag, tmp_path / "out.tum", "--plot", picture)
    assert status == 0
    assert f"/odom{SHOWN}: 3 poses in the frame map{SHOWN}" in text
    assert "\x1b" not in picture.read_text()


@pytest.mark.parametrize("command", ["info", "bag", "video", "kitti", "trajectory"])
def test_errors_are_one_line_of_what_they_are_about(folder, command):
    more = ["out.tum"] if command == "trajectory" else []
    status, text = run(command, folder / "missing", *more)
    assert status == 2
    assert SHOWN in text
    assert len(text.splitlines()) == 1


def test_keys_of_parameters_and_arguments_are_shown(folder):
    path = folder / "params.yaml"
    path.write_text('"\\e[2J": {fps: 1}\n')
    status, text = run("demo", "landscape", "--view", "none", "--params", path)
    assert (status, r"\x1b[2J" in text) == (2, True)
    status, text = run("demo", EVIL.replace("\0", ""))
    assert (status, SHOWN in text) == (2, True)


def test_logs_are_shown_and_a_traceback_keeps_its_lines():
    try:
        raise ValueError(EVIL)
    except ValueError:
        record = logging.LogRecord("n", 40, "f", 1, "of %s", (EVIL,), sys.exc_info())
    lines = EscapingFormatter("%(message)s").format(record).split("\n")
    assert lines[0] == f"of {SHOWN}"
    assert lines[1].startswith("Traceback")
    assert all(line.isprintable() for line in lines)


def test_a_full_disk_for_the_answer_is_said_once(bag):
    with open("/dev/full", "wb") as full:
        done = subprocess.run([*COMMAND, "info", bag], stdout=full, stderr=subprocess.PIPE)
    assert done.returncode == 1
    assert done.stderr == b"ros-visualise: standard output: No space left on device\n"


@pytest.mark.parametrize(
    ("address", "told"),
    [
        ("rtsp://me:p@ss:word@10.0.0.5:554/s", "rtsp://me:***@10.0.0.5:554/s"),
        ("http://10.0.0.5/v.cgi?user=me&pwd=secret", "http://10.0.0.5/v.cgi?***"),
        ("http://:secret@host", "http://:***@host"),
        ("rtsp://host:554/a@b:c", "rtsp://host:554/a@b:c"),
        ("ws://host:8080/0123456789abcdefghijk_/foxglove", "ws://host:8080/***/foxglove"),
        ("ws://host:8765/foxglove", "ws://host:8765/foxglove"),
        ("/dev/video0", "/dev/video0"),
        ("is it a:b@c?", "is it a:b@c?"),
    ],
)
def test_addresses_are_shown_without_passwords(address, told):
    assert without_secrets(address) == told
