"""Ctrl-C at any moment, a second one, and terminals that are closed."""

import fcntl
import os
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path

import numpy as np
import pytest
from made_bags import START_NS, BagWriter
from mcap.reader import make_reader
from rosbags.rosbag1 import Reader
from waiting import bytes_in, wait_for

from ros_visualise.data import Header, Image
from ros_visualise.messages.recorded import TopicType
from ros_visualise.running.executables import command_of
from ros_visualise.sinks import open_recorder

COMMAND = [sys.executable, "-m", "ros_visualise"]
CAMERA = ["camera", "test", "--view", "none", "--size", "64x48"]
PATIENCE_S = 30.0
SOURCES = Path(__file__).parents[2] / "src"

INTERRUPTED_IMPORT = """
import os, signal, sys

class Finder:
    def find_spec(self, name, *_):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Finder())
from ros_visualise.__main__ import main
sys.argv[1:] = {arguments!r}
sys.exit(main())
"""

LEFT_BEHIND = """
import sys, threading, time
import mujoco
from ros_visualise import commands
from ros_visualise.__main__ import main

model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
)

def work():
    data = mujoco.MjData(model)
    while True:
        mujoco.mj_step(model, data, nstep=20000)

def command():
    print("begun")
    threading.Thread(target=work, daemon=True).start()
    time.sleep(0.2)
    raise KeyboardInterrupt

commands.main = command
sys.exit(main())
"""


class Terminal:
    """A command with a terminal of its own, as a shell gives it one."""

    def __init__(self, *command, **options):
        self.master, slave = os.openpty()
        self.process = subprocess.Popen(
            [str(part) for part in command],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
            **options,
        )
        os.close(slave)

    def close(self):
        os.close(self.master)

    def wait(self):
        return self.process.wait(PATIENCE_S)


def wait_for_messages(process, path):
    """Until something stands in a recording."""
    wait_for(lambda: bytes_in(path) > 20_000, "messages in it", process=process)


def count(path):
    """Messages of an MCAP file that was closed."""
    with path.open("rb") as file:
        statistics = make_reader(file).get_summary().statistics
    assert statistics.message_count > 0
    return statistics.message_count


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_executable_that_is_ended_while_it_begins_has_not_died(tmp_path, number):
    """With another exit status than 0 ``ros2 launch`` says that it has died."""
    (tmp_path / "ament_index_python.py").write_text("print('begun', flush=True); input()")
    process = subprocess.Popen(
        command_of("filters"),
        env={**os.environ, "PYTHONPATH": f"{tmp_path}:{SOURCES}", "ROS_VERSION": "2"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "begun\n"
    process.send_signal(number)
    _, said = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, said) == (0, "")


@pytest.mark.parametrize(
    "module",
    [
        "ros_visualise.core.signals",
        "ros_visualise.commands",
        "argparse",
        "ros_visualise.commands.demo",
        "ros_visualise.running.play",
        "numpy",
        "numpy.linalg",
        "cv2",
        "av.container",
        "nicegui",
        "ros_visualise.ui.page",
    ],
)
def test_ctrl_c_during_an_import_ends_without_a_word(module):
    code = INTERRUPTED_IMPORT.format(module=module, arguments=["demo", "landscape", "--port", "1"])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=PATIENCE_S)
    assert done.returncode in (130, -signal.SIGINT)  # a shell has 130 for either
    assert done.stderr == b""


def test_a_closed_terminal_ends_as_ctrl_c_does(tmp_path):
    path = tmp_path / "out.mcap"
    terminal = Terminal(*COMMAND, *CAMERA, "--json", "--record", path)
    wait_for_messages(terminal.process, path)
    terminal.close()
    assert terminal.wait() == 130
    assert count(path)


def test_a_closed_terminal_ends_a_conversion(tmp_path):
    source, path = tmp_path / "long.mcap", tmp_path / "out.bag"
    noise = np.random.default_rng(0).integers(0, 255, (700, 700), np.uint8)
    with open_recorder(str(source), {"/i": TopicType("sensor_msgs/msg/Image")}) as recorder:
        for number in range(60):  # which take bzip2 a while
            recorder.write("/i", Image(noise, "mono8", Header(number)))
    terminal = Terminal(*COMMAND, "convert", source, path, "--compression", "bz2")
    wait_for_messages(terminal.process, path)
    terminal.close()
    assert terminal.wait() == 130
    with Reader(path) as bag:
        assert 0 < bag.message_count < 60


def test_nohup_goes_on_without_its_terminal(tmp_path):
    path = tmp_path / "out.mcap"
    command = ["nohup", *COMMAND, *CAMERA, "--frames", "90", "--record", path]
    terminal = Terminal(*command, cwd=tmp_path)
    wait_for_messages(terminal.process, path)
    terminal.close()
    assert terminal.wait() == 0
    assert count(path) > 90


def test_output_to_a_terminal_that_is_gone_harms_no_recording(tmp_path):
    path = tmp_path / "out.mcap"
    terminal = Terminal("env", "--ignore-signal=HUP", *COMMAND, *CAMERA, "--json", "--record", path)
    wait_for_messages(terminal.process, path)
    terminal.close()
    time.sleep(0.3)  # in which the progress bar is drawn
    terminal.process.send_signal(signal.SIGINT)
    assert terminal.wait() == 130
    assert count(path)


def test_a_run_that_ends_by_itself_needs_no_terminal(tmp_path):
    path = tmp_path / "out.mcap"
    record = ["--frames", "120", "--record", path]
    terminal = Terminal("env", "--ignore-signal=HUP", *COMMAND, *CAMERA, *record)
    wait_for_messages(terminal.process, path)
    terminal.close()
    assert terminal.wait() == 0
    assert count(path) > 120


def test_a_second_ctrl_c_disturbs_nothing(tmp_path):
    path = tmp_path / "out.mcap"
    process = subprocess.Popen(
        [*COMMAND, *CAMERA, "--record", path], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    wait_for_messages(process, path)
    while process.poll() is None:
        process.send_signal(signal.SIGINT)
        time.sleep(0.002)
    assert b"Traceback" not in process.communicate()[1]
    assert process.returncode == 130
    assert count(path)


def megabytes_of(process):
    """Resident memory."""
    return int(Path(f"/proc/{process.pid}/statm").read_text().split()[1]) * 4096 / 1e6


def cpu_seconds_of(process):
    """CPU time so far."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.parametrize("command", ["convert", "bag"])
def test_one_message_that_takes_long_holds_up_no_ctrl_c(tmp_path, command):
    source, path = tmp_path / "long.bag", tmp_path / "out.mcap"
    definition = f"p/A[] a\n{'=' * 80}\nMSG: p/A\nuint8 x\n"
    with BagWriter(source, "lz4") as bag:
        bag.connect("a", "/a", "p/msg/T", typestore=None, msgdef=definition, md5sum="0" * 32)
        bag.write("a", START_NS, (120_000_000).to_bytes(4, "little") + bytes(120_000_000))
    play = ["--view", "none", "--rate", "0", "--record"] if command == "bag" else []
    process = subprocess.Popen([*COMMAND, command, source, *play, path], stderr=subprocess.PIPE)
    wait_for(path.exists, "the recording", process=process)
    wait_for(lambda: megabytes_of(process) > 180, "the message, unpacked", process=process)
    begun_s = cpu_seconds_of(process)
    wait_for(lambda: cpu_seconds_of(process) > begun_s + 1, "work on it", process=process)
    process.send_signal(signal.SIGINT)
    try:
        _, said = process.communicate(timeout=PATIENCE_S)  # the message alone takes half a minute
    finally:
        process.kill()
    assert process.returncode == 130
    assert b"forced exit: a message did not finish" in said
    assert path.exists()


def test_a_thread_that_is_left_in_a_library_does_not_crash_the_process():
    """As one that still opens a simulation."""
    left = [sys.executable, "-c", LEFT_BEHIND]
    ended = subprocess.run(left, capture_output=True, text=True, timeout=PATIENCE_S)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "begun\n", "")
