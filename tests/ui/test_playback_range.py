"""``--start`` and ``--duration`` in a view that stays: the playback range of what has an end."""

import signal
import subprocess
import sys

import forked
import pytest
from made_videos import numbered, write_video
from page_client import TOKEN, ClockClient, Live, wait_in

from ros_visualise.graph.pipelines import image_pipeline, simulation_pipeline
from ros_visualise.running.options import PlayingOptions
from ros_visualise.running.play import _playback
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.ui import ViewOptions, read_arrangement
from ros_visualise.ui.page import Page

OPTIONS = PlayingOptions(start=0.1, duration=0.2)
WHOLE = {"playback range/start": 0.0, "playback range/end": 0.0}


@pytest.fixture
def runtime():
    """The demo, paused, with a range of the command line."""
    graph = image_pipeline("landscape")
    playback = _playback(OPTIONS, graph, stays=True)
    playback.pause()
    running = LocalRuntime(graph, playback)
    running.start()
    yield running
    running.stop()


@pytest.mark.parametrize(
    ("graph", "stays", "part_s"),
    [
        (image_pipeline("streamer"), True, (0.1, pytest.approx(0.3))),
        (image_pipeline("streamer"), False, (0.0, None)),
        (image_pipeline("camera"), True, (0.0, None)),
        (simulation_pipeline("husky"), True, (0.0, None)),
    ],
    ids=["film", "film without a view", "camera", "simulation"],
)
def test_the_range_is_that_of_a_film_in_a_view(graph, stays, part_s):
    playback = _playback(OPTIONS, graph, stays)
    assert playback.state.part_s == part_s
    assert playback.holds is (part_s != (0.0, None))


def test_the_page_stays_at_the_end_of_the_range_and_loops_it(tmp_path, port):
    film = write_video(tmp_path / "film.mkv", numbered(25))
    options = ["--start", "0.2", "--duration", "0.2", "--port", str(port), "--no-open"]
    command = [sys.executable, "-m", "ros_visualise", "video", str(film), *options]
    with forked.Forked(command, text=True, stderr=subprocess.PIPE) as process:
        assert any("open http" in line for line in process.stderr)
        with ClockClient(port, TOKEN) as clock:
            ended = clock.read_until(lambda state: state["ended"])
            assert ended["part"] == [0.2, pytest.approx(0.4)]
            assert ended["position"] == pytest.approx(0.4)
            clock.act(loop=True)
            assert 0.2 <= clock.read_until(lambda state: not state["ended"])["position"] <= 0.4
            clock.act(whole=True)
            clock.read_until(lambda state: state["position"] > 0.4)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130


def save(client, path):
    client.send("save", what="layout", name=path.name)
    client.read_until(lambda: client.state.get("saved") == str(path))
    found = read_arrangement(path)
    return {place: value for place, value in found.items() if "range" in place}


def test_a_layout_holds_the_range_once_a_person_has_changed_it(port, runtime, tmp_path):
    page = Page(ViewOptions(port=port, record_dir=tmp_path))
    page.open(runtime)
    with Live(port, "/live/files") as client:
        assert save(client, tmp_path / "first.yaml") == {}
        runtime.playback.set_part(0.1, 5.0)
        longer = {"playback range/start": 0.1, "playback range/end": 5.0}
        assert save(client, tmp_path / "longer.yaml") == longer
        runtime.playback.set_part()
        assert save(client, tmp_path / "whole.yaml") == WHOLE
    page.close()


def test_a_range_that_was_cleared_is_so_again(port, runtime):
    page = Page(ViewOptions(port=port, arrangement=WHOLE))
    page.open(runtime)
    assert runtime.playback.state.part_s == (0.0, None)
    page.close()


def test_the_address_holds_the_range_once_a_person_has_changed_it(browse, runtime):
    tab = browse("?layout={~panel~:~nodes~}", images=False)
    runtime.parameters["filters"].update({"threshold": 77})
    wait_in(tab, lambda: tab.url.endswith("#filters/threshold=77"))
    assert tab.evaluate("rv.clock.state.part")[0] == 0.1
    tab.evaluate("rv.clock.act({ whole: true })")
    wait_in(tab, lambda: tab.url.endswith("&playback%20range/start=0&playback%20range/end=0"))
    runtime.playback.set_part(*runtime.playback.first_part_s)
    wait_in(tab, lambda: tab.url.endswith("#filters/threshold=77"))
