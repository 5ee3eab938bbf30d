"""Opening another file from the page: the same nodes as they are set, and nothing is lost."""

import json
import signal
import subprocess
import sys

import forked
import pytest
from made_videos import numbered, write_video
from page_client import TOKEN, ClockClient, Live, get
from waiting import wait_for

from ros_visualise.commands import main

COMMAND = [sys.executable, "-m", "ros_visualise"]
HANGING = """
import sys, threading
from ros_visualise.running import play
from ros_visualise.__main__ import main

def following(*_):
    print("opening", file=sys.stderr, flush=True)
    threading.Event().wait()

play.following = following
sys.exit(main())
"""
PATIENCE_S = 60


@pytest.fixture
def folder(tmp_path):
    for name in ("one.mkv", "two.mkv"):
        write_video(tmp_path / name, numbered(10))
    (tmp_path / "junk.mp4").write_text("nothing that anybody plays")
    played = ["video", str(tmp_path / "one.mkv"), "--view", "none", "--rate", "0"]
    assert main([*played, "--record", str(tmp_path / "three.bag@/image_raw")]) == 0
    return tmp_path


@pytest.fixture
def command():
    """The program."""
    return COMMAND


@pytest.fixture
def run(command, folder, port):
    """The command with its page, and a browser; ends with the report of the run."""
    options = ["--port", str(port), "--no-open", "--json", "--record-dir", str(folder)]
    options += ["--set", "filters.threshold=90", "--record", str(folder / "run.mcap")]
    process = forked.Forked(
        [*command, "video", "one.mkv", *options],
        cwd=folder,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    for line in process.stderr:
        if "open http" in line:
            break
    yield process
    process.kill()
    process.communicate()


@pytest.fixture
def client(run, port):
    with Live(port, "/live/files") as client:
        client.read_until(lambda: "two.mkv" in client.state.get("files", []))
        yield client


@pytest.fixture
def nodes(run, port):
    with Live(port, "/live/nodes") as nodes:
        nodes.read_until(lambda: "filters" in nodes.values)
        yield nodes


def open_next(client, name, port, title=""):
    client.send("open", name=name)
    wait_for(lambda: f"<title>{title or name} " in get(port)[2], "the page's title")


def test_another_file_is_shown_as_the_one_before(run, client, nodes, folder, port):
    assert nodes.set("filters", "threshold", 77)["reason"] == ""
    with ClockClient(port, TOKEN) as clock:
        clock.act(loop=True)
        clock.read_until(lambda state: state["loop"])
    client.send("open", name="junk.mp4")
    nodes.read_until(lambda: nodes.said("junk.mp4: "))

    open_next(client, "two.mkv", port)
    with ClockClient(port, TOKEN) as clock:
        clock.read_until(lambda state: state["loop"])
    for name in ("two.mkv", "three.bag"):
        open_next(client, name, port)
        with Live(port, "/live/nodes") as later:
            later.read_until(lambda later=later: "filters" in later.values)
            assert later.values["filters"]["threshold"] == 77
            assert later.first["filters"]["threshold"] == 90
    client.read_until(lambda: client.state["recent"][0].endswith("three.bag"))
    open_next(client, "test", port, title="camera")
    nodes.read_until(lambda: nodes.state["graph"][0] == "camera")
    open_next(client, "three.bag", port)
    client.send("save", what="layout", name="mine.yaml")
    client.read_until(lambda: client.state.get("saved"))
    assert "filters/threshold: 77" in (folder / "mine.yaml").read_text()
    run.send_signal(signal.SIGINT)
    out, err = run.communicate(timeout=PATIENCE_S)
    assert run.returncode == 130
    report = json.loads(out)
    assert "player" in report["nodes"]
    assert report["recordings"][str(folder / "run.mcap")]["messages"] > 0
    assert "Traceback" not in err


@pytest.mark.parametrize("command", [[sys.executable, "-c", HANGING]], ids=["hanging"])
def test_a_command_ends_while_a_file_is_opened_from_its_page(run, client, folder):
    client.send("open", name="two.mkv")
    assert any("opening" in line for line in run.stderr)
    run.send_signal(signal.SIGINT)
    out, _ = run.communicate(timeout=PATIENCE_S)
    assert run.returncode == 130
    assert json.loads(out)["recordings"][str(folder / "run.mcap")]["messages"] > 0
