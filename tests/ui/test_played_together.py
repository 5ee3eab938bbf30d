"""Several sources on the page's timeline: offsets, seeks, plots, one more from the files."""

import subprocess
import sys
from contextlib import closing

import forked
import pytest
from hub_client import HubClient
from made_videos import numbered, write_video
from page_client import TOKEN, VIEW_TOKEN, ClockClient, Live, get, wait_in
from scene_messages import odometry
from waiting import wait_for

from ros_visualise.data import Odometry
from ros_visualise.graph.pipelines import recording_pipeline
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_joined
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.live.plots import PlotHub
from ros_visualise.ui.server.host import page_loop
from ros_visualise.ui.shell.layouts import images_to_show

START_S = 1_600_000_000


def write_run(path, start_s, length_s=10):
    """A run whose x is the seconds since its own start."""
    with open_recorder(str(path), {"/odom": TopicType(Odometry.type_name)}) as recorder:
        for number in range(10 * length_s):
            at_s = start_s + number / 10
            recorder.write("/odom", odometry([number / 10, 0, 0], at_s), round(at_s * 1e9))
    return path


@pytest.fixture
def runs(tmp_path):
    return [write_run(tmp_path / f"{name}.mcap", START_S + at) for name, at in (("a", 0), ("b", 2))]


@pytest.fixture
def runtime(runs):
    """Both, paused."""
    playback = Playback(hold=True)
    playback.pause()
    running = LocalRuntime(recording_pipeline(open_joined(runs), odom=""), playback)
    running.start()
    yield running
    running.stop()


def shown_x(runtime, topic):
    with closing(runtime.subscribe(topic)) as subscription:
        message = subscription.take(0)
    return None if message is None else message.position_xyz[0]


def are_at(runtime, a, b):
    shown = [shown_x(runtime, f"/{name}/odom") for name in "ab"]
    return shown == [pytest.approx(a), pytest.approx(b)]


def test_offsets_hold_at_seeks_and_steps(runtime):
    playback, player = runtime.playback, runtime.parameters["player"]
    playback.seek(5)
    wait_for(lambda: are_at(runtime, 5, 3))
    player.update({"b": -1.5})
    wait_for(lambda: are_at(runtime, 5, 4.5))
    playback.step(-1)
    wait_for(lambda: are_at(runtime, 4.9, 4.4))
    player.update({"b": -4.0})  # it begins first, and the timeline with it
    wait_for(lambda: playback.sources[0].begin_s == 2)
    wait_for(lambda: are_at(runtime, 4.9, 6.9))
    assert playback.state.position_s == pytest.approx(6.9)
    assert [one.begin_s for one in playback.sources] == [2, 0]
    playback.seek(3)
    wait_for(lambda: are_at(runtime, 1, 3))
    with pytest.raises(Exception, match="must be from"):
        player.update({"b": float("nan")})


def test_plots_follow_an_offset(runtime):
    hub, curve = PlotHub(page_loop()), "/b/odom:pose.pose.position.x"
    with closing(hub):
        hub.show(runtime)
        with HubClient(hub) as client:
            for offset, start_s in ((0, 2), (1, 3)):
                runtime.parameters["player"].update({"b": offset})
                client.send(views=[{"curve": curve}], number=offset, columns=4000)
                whole = client.read_until(
                    lambda one, start=start_s, number=offset: (
                        one.get("number") == number
                        and one.get("share") == 1
                        and one["rows"][0, 0] == pytest.approx(start)
                    )
                )
                assert whole["rows"][-1] == pytest.approx([start_s + 9.9, 9.9])


def test_each_film_has_an_image(tmp_path):
    films = [write_video(tmp_path / f"{name}.mkv", numbered(5)) for name in "ab"]
    with closing(open_joined(films)) as joined:
        shown = images_to_show(recording_pipeline(joined))
    assert shown[:2] == ["/a/image_raw", "/b/image_raw"]
    assert "/edges" in shown


@pytest.fixture
def run(tmp_path, port):
    """A film on a page, with a log in the folder."""
    write_run(tmp_path / "log.mcap", START_S)
    film = write_video(tmp_path / "film.mkv", numbered(50))
    command = [sys.executable, "-m", "ros_visualise", str(film), "--port", str(port), "--no-open"]
    with forked.Forked(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        assert any("open http" in line for line in process.stderr)
        yield process
        process.terminate()
        process.communicate()


def test_a_log_is_added_to_a_film_and_dragged(run, chromium, port):
    with ClockClient(port, TOKEN) as clock, Live(port, "/live/files") as files:
        clock.act(seek=1.2)
        clock.act(toggle=1)
        clock.read_until(lambda state: state.get("position") == 1.2)
        with Live(port, "/live/files", VIEW_TOKEN) as viewer:
            viewer.send("open", name="film.mkv", add=True)
        files.send("open", name="test", add=True)
        files.read_until(lambda: "log.mcap" in files.state.get("files", []))
        files.send("open", name="log.mcap", add=True)
        wait_for(lambda: "<title>film.mkv, log.mcap " in get(port)[2])
        clock.read_until(lambda state: len(state["sources"]) == 2 and state["position"] == 1.2)
        clock.act(mark=[0.5, "there"])
        clock.read_until(lambda state: state["marks"] == [[0.5, "there"]])
    tab = chromium.new_page(viewport={"width": 1280, "height": 720})
    tab.goto(f"http://127.0.0.1:{port}/{TOKEN}")
    bar, offset = tab.locator(".rv-span", has_text="log"), tab.get_by_label("Offset of log.mcap")
    bar.wait_for(timeout=60_000)
    wait_in(tab, lambda: offset.input_value() == "0")
    box = bar.bounding_box()
    tab.mouse.move(box["x"] + 50, box["y"] + 8)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 50 + box["width"] / 10, box["y"] + 8, steps=3)
    tab.mouse.up()
    wait_in(tab, lambda: "player/log=" in tab.url)
    assert float(tab.url.rpartition("=")[2]) == pytest.approx(1, abs=0.1)
    offset.focus()
    offset.fill("-0.75")
    offset.press("Enter")
    wait_in(tab, lambda: tab.url.endswith("player/log=-0.75"))
    wait_in(tab, lambda: tab.get_by_role("button", name="Mark there at 0:01.25").count() == 1)
    address = tab.url
    offset.fill("0")
    offset.press("Enter")
    wait_in(tab, lambda: "log=" not in tab.url)
    tab.close()
    tab = chromium.new_page()
    tab.goto(address)
    again = tab.get_by_label("Offset of log.mcap")
    wait_in(tab, lambda: again.count() and again.input_value() == "-0.75")
    tab.close()
