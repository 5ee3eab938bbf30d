"""The timeline's clock, as browsers move it: nothing that they send does anything else."""

import json
from types import SimpleNamespace

import pytest
from page_client import TOKEN, VIEW_TOKEN, ClockClient
from waiting import wait_for

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.live.clock import PageClock
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
    wait_for(lambda: playback.state.duration_s is not None)
    yield playback
    page.close()
    running.stop()


@pytest.fixture
def clock(playback, port):
    with ClockClient(port, TOKEN) as client:
        yield client


def test_the_topic_of_a_step_is_chosen(clock, playback):
    assert clock.read_until(lambda state: state)["topic"] == "/image"
    clock.act(topic="/imu")
    wait_for(lambda: playback.step_topic == "/imu")
    clock.act(topic="/none")
    clock.act(topic="")
    wait_for(lambda: playback.step_topic == "")
    assert clock.read_until(lambda state: state["topic"] == "")["topics"] == ["/image", "/imu"]


def test_the_start_has_the_stamp_from_which_times_count(clock, playback):
    start_s = clock.read_until(lambda state: state["start"])["start"]
    assert start_s == pytest.approx(playback.start_stamp_ns / 1e9, abs=1e-6)


@pytest.mark.parametrize("rate", [0, 0.1, 100.0])
def test_the_rate_goes_far(clock, playback, rate):
    clock.act(rate=rate)
    wait_for(lambda: playback.state.rate == rate)


def test_steps_and_seeks_are_shown_by_all(clock, playback, port):
    with ClockClient(port, TOKEN) as other:
        clock.act(step=True)
        wait_for(lambda: playback.state.position_s > 0)
        assert not playback.state.playing
        clock.act(seek=12.5)
        for one in (clock, other):
            one.read_until(lambda state: state["position"] == 12.5)
        other.act(step=False)
        clock.read_until(lambda state: state["position"] < 12.5)
        other.act(toggle=1)
        clock.read_until(lambda state: state["playing"])
        other.act(loop=True)
        clock.read_until(lambda state: state["loop"])


def test_what_comes_before_the_page_has_heard_of_the_first_adds_up():
    playback, clock = Playback(hold=True), PageClock()
    clock.show(SimpleNamespace(playback=playback, graph=SimpleNamespace(live=False, source=None)))

    def act(*actions):
        for action, value in actions:
            clock.act(json.dumps({action: value}))
        return playback.state

    assert act(("skip", 5), ("skip", 5), ("skip", -2)).position_s == 8
    assert act(("skip", -50)).position_s == 0
    assert act(("faster", True), ("faster", True)).rate == 4
    assert act(*[("faster", True)] * 3).rate == 8
    assert act(("rate", 0), ("faster", False)).rate == 8
    assert act(*[("faster", False)] * 9).rate == 0.1
    assert act(("loop", None)).loop
    assert not act(("loop", None)).loop


def test_a_range_is_set_by_keys_and_numbers(clock, playback):
    playback.seek(3.0)
    clock.read_until(lambda state: state["position"] == 3.0)
    clock.act(begin=1)
    clock.read_until(lambda state: state["part"] == [3.0, None])
    playback.seek(5.0)
    clock.read_until(lambda state: state["position"] == 5.0)
    clock.act(end=1)
    clock.read_until(lambda state: state["part"] == [3.0, 5.0])
    clock.act(begin_at=6.25)
    clock.read_until(lambda state: state["part"] == [6.25, None])
    clock.act(end_at=4.0)
    clock.read_until(lambda state: state["part"] == [0.0, 4.0])
    clock.act(whole=1)
    clock.read_until(lambda state: state["part"] == [0.0, None])


def test_a_viewer_sees_the_time_and_moves_nothing(clock, playback, port):
    before = playback.state
    with ClockClient(port, VIEW_TOKEN) as viewer:
        moving = ("toggle", "step", "seek", "skip", "rate", "faster", "loop")
        for action in (*moving, "begin", "end", "end_at", "topic"):
            viewer.act(**{action: 5})
        clock.act(seek=2.0)
        viewer.read_until(lambda state: state["position"] == 2.0)
    assert playback.state == before._replace(position_s=2.0)


WILD = (None, True, "x", "", [], {}, [1], {"a": 1}, float("nan"), float("inf"), -1e999, -5, 1e300)


def test_nonsense_is_ignored():
    playback, clock = Playback(hold=True), PageClock()
    clock.act('{"toggle": 1}')  # without a playback
    assert clock.state == {}
    clock.show(SimpleNamespace(playback=playback, graph=SimpleNamespace(live=False, source=None)))
    for text in ("", "x", "[]", "{}", "null", "[" * 50_000, '{"act": 1}', '{"__class__": 1}'):
        clock.act(text)
    for action in ("seek", "skip", "rate", "topic", "begin_at", "end_at"):
        for value in WILD:
            clock.act(json.dumps({action: value}))
    assert 0 <= playback.state.rate <= 100
    assert 0 <= playback.state.position_s <= 1e9
    assert playback.step_topic == ""
    json.dumps(clock.state, allow_nan=False)
