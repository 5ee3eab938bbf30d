"""Opening another file from the page: the same nodes as they are set, and nothing is lost."""

import json
import signal
import subprocess
import sys
from contextlib import closing

import pytest
from made_videos import numbered, write_video
from page_client import TOKEN, Client, ClockClient, get
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
    process = subprocess.Popen(
        [*command, "video", "one.mkv", *options],
        cwd=folder,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    for line in process.stderr:
        if "look at" in line:
            break
    yield process
    process.kill()
    process.communicate()


@pytest.fixture
def client(run, port):
    client = Client(port)
    with closing(client):
        client.read_until(lambda: "Source" in client.values)
        yield client


def open_next(client, name):
    client.html.clear()
    client.set("Source", name)
    port = client.socket.remote_address[1]
    wait_for(lambda: f"<title>{name} " in get(port)[2], "the page's title")


def test_another_file_is_shown_as_the_one_before(run, client, folder):
    client.set("Threshold", 77)
    port = client.socket.remote_address[1]
    with ClockClient(port, TOKEN) as clock:
        clock.act(loop=True)
        clock.read_until(lambda state: state["loop"])
    client.read_until(lambda: any("threshold=77" in html for html in client.html))
    client.set("Source", "junk.mp4")
    client.read_until(lambda: any("junk.mp4: " in html for html in client.html))

    open_next(client, "two.mkv")
    with ClockClient(port, TOKEN) as clock:
        clock.read_until(lambda state: state["loop"])
    client.read_until(lambda: client.values.get("Threshold") == 77)
    assert client.values["Threshold"] == 77
    client.read_until(lambda: any("threshold=77" in html for html in client.html))
    client.set("edge_detector", False)  # its window
    kept = "windows/edge_detector=False"
    client.read_until(lambda: any(kept in html for html in client.html))

    open_next(client, "three.bag")
    client.read_until(lambda: client.values.get("edge_detector") is False)
    assert client.values["Threshold"] == 77
    run.send_signal(signal.SIGINT)
    out, err = run.communicate(timeout=PATIENCE_S)
    assert run.returncode == 130
    report = json.loads(out)
    assert "player" in report["nodes"]
    assert report["recordings"][str(folder / "run.mcap")]["messages"] > 0
    assert "Traceback" not in err


@pytest.mark.parametrize("command", [[sys.executable, "-c", HANGING]], ids=["hanging"])
def test_a_command_ends_while_a_file_is_opened_from_its_page(run, client, folder):
    client.set("Source", "two.mkv")
    assert any("opening" in line for line in run.stderr)
    run.send_signal(signal.SIGINT)
    out, _ = run.communicate(timeout=PATIENCE_S)
    assert run.returncode == 130
    assert json.loads(out)["recordings"][str(folder / "run.mcap")]["messages"] > 0
