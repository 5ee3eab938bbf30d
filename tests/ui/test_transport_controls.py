"""The controls of playback, as a browser moves them."""

import time

import pytest
from page_client import Client

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.page import Page


@pytest.fixture
def playback(port):
    playback = Playback(hold=True)
    playback.pause()
    playback.step_topics = ("/image", "/imu")
    playback.step_topic = "/image"
    running = LocalRuntime(image_pipeline("landscape"), playback)
    page = Page(port=port)
    page.open(running)
    running.start()
    yield playback
    page.close()
    running.stop()


@pytest.fixture
def client(playback, port):
    client = Client(port)
    client.read_until(lambda: "step by" in client.values)
    yield client
    client.socket.close()


def wait_until(check):
    end_s = time.monotonic() + 60
    while not check():
        assert time.monotonic() < end_s, "it did not come about"
        time.sleep(0.01)


def test_the_topic_of_a_step_is_chosen(client, playback):
    assert client.values["step by"] == "/image"
    client.set("step by", "/imu")
    wait_until(lambda: playback.step_topic == "/imu")
    client.set("step by", "any message")
    wait_until(lambda: playback.step_topic == "")


@pytest.mark.parametrize("rate", [0.1, 100.0])
def test_the_rate_goes_far(client, playback, rate):
    client.set("rate", rate)
    wait_until(lambda: playback.state.rate == rate)


def test_a_step_shows_the_next_image(client, playback):
    wait_until(lambda: playback.state.duration_s is not None)
    before = playback.state.position_s
    client.set("playback", "▸")
    wait_until(lambda: playback.state.position_s > before)
    assert not playback.state.playing


def test_marks_are_numbers_buttons_and_keys(client, playback):
    playback.seek(3.0)
    wait_until(lambda: playback.state.position_s == 3.0)
    client.set("marks", "[ here")
    wait_until(lambda: playback.state.part_s == (3.0, None))
    client.read_until(lambda: client.values["from"] == 3.0)
    playback.seek(5.0)
    client.set("marks", "here ]")
    wait_until(lambda: playback.state.part_s == (3.0, 5.0))
    client.read_until(lambda: client.values["to"] == 5.0)
    client.read_until(lambda: any("part/from=3.0&amp;part/to=5.0" in h for h in client.html))
    client.set("from", 6.25)
    wait_until(lambda: playback.state.part_s == (6.25, None))
    client.set("to", 4.0)
    wait_until(lambda: playback.state.part_s == (0.0, 4.0))
    client.set("marks", "none")
    wait_until(lambda: playback.state.part_s == (0.0, None))
