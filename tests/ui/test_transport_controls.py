"""The controls of playback, as a browser moves them."""

import pytest
from page_client import Client
from waiting import wait_for

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page


@pytest.fixture
def playback(port):
    playback = Playback(hold=True)
    playback.pause()
    playback.step_topics = ("/image", "/imu")
    playback.step_topic = "/image"
    running = LocalRuntime(image_pipeline("landscape"), playback)
    page = Page(ViewOptions(port=port))
    page.open(running)
    running.start()
    yield playback
    page.close()
    running.stop()


@pytest.fixture
def client(playback, port):
    client = Client(port)
    client.read_until(lambda: "Step by" in client.values)
    yield client
    client.close()


def test_the_topic_of_a_step_is_chosen(client, playback):
    assert client.values["Step by"] == "/image"
    client.set("Step by", "/imu")
    wait_for(lambda: playback.step_topic == "/imu")
    client.set("Step by", "Any message")
    wait_for(lambda: playback.step_topic == "")


@pytest.mark.parametrize("rate", [0.1, 100.0])
def test_the_rate_goes_far(client, playback, rate):
    client.set("Rate", rate)
    wait_for(lambda: playback.state.rate == rate)


def test_a_step_shows_the_next_image(client, playback):
    wait_for(lambda: playback.state.duration_s is not None)
    before = playback.state.position_s
    client.set("Playback", "▸")
    wait_for(lambda: playback.state.position_s > before)
    assert not playback.state.playing


def test_marks_are_numbers_buttons_and_keys(client, playback):
    playback.seek(3.0)
    wait_for(lambda: playback.state.position_s == 3.0)
    client.set("Range", "Set start")
    wait_for(lambda: playback.state.part_s == (3.0, None))
    client.read_until(lambda: client.values["Start"] == 3.0)
    playback.seek(5.0)
    client.set("Range", "Set end")
    wait_for(lambda: playback.state.part_s == (3.0, 5.0))
    client.read_until(lambda: client.values["End"] == 5.0)
    address = "playback%20range/start=3.0&amp;playback%20range/end=5.0"
    client.read_until(lambda: any(address in h for h in client.html))
    client.set("Start", 6.25)
    wait_for(lambda: playback.state.part_s == (6.25, None))
    client.set("End", 4.0)
    wait_for(lambda: playback.state.part_s == (0.0, 4.0))
    client.set("Range", "Clear")
    wait_for(lambda: playback.state.part_s == (0.0, None))
