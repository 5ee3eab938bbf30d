"""Going back through the last minutes of a live graph."""

from itertools import takewhile

import numpy as np
import pytest
from hub_client import HubClient
from scene_runtime import Told
from waiting import wait_for

from ros_visualise.data import Header, Image, Odometry, Text
from ros_visualise.ui.live.clock import PageClock
from ros_visualise.ui.live.live_buffer import LiveBuffer, packed
from ros_visualise.ui.live.rewinding import Rewinder

NS = 10**9


def text(number):
    return Text(str(number), Header(number * NS))


def filled(most_bytes=10**9, count=20):
    buffer = LiveBuffer(most_bytes)
    for number in range(count):
        buffer.add(number * NS, "/a" if number % 2 else "/b", text(number))
    return buffer


def texts(batches):
    """The texts until there are no more."""
    found = takewhile(bool, (batch for _, batch in batches))
    return [[one.message.text for one in batch] for batch in found]


def test_reading_begins_with_what_was_shown_then():
    read = texts(filled().read(10 * NS))
    assert read[0] == ["9", "10"]
    assert read[1:] == [[str(number)] for number in range(11, 20)]
    assert texts(filled().read(99 * NS)) == [["18", "19"]]


def test_the_oldest_go_where_memory_or_time_is_short():
    buffer = filled(most_bytes=text(10).nbytes * 5)
    assert buffer.begin_ns == 15 * NS
    assert buffer.nbytes <= buffer.most_bytes
    assert texts(buffer.read(0))[0] == ["13", "14"]
    buffer.add(10**15, "/a", text(99))
    assert buffer.begin_ns == 10**15


def test_reading_goes_on_with_the_oldest_where_what_came_next_was_dropped():
    buffer = filled(most_bytes=text(10).nbytes * 5, count=5)
    reading = buffer.read(0)
    next(reading)
    for number in range(5, 20):
        buffer.add(number * NS, "/a", text(number))
    assert texts(reading) == [[str(number)] for number in range(15, 20)]


@pytest.mark.parametrize("encoding", ["mono8", "bgr8", "mono16", "32FC1", "bayer_rggb8", "rgba8"])
def test_images_are_packed(encoding):
    kinds = {"mono16": np.uint16, "32FC1": np.float32}
    shape = {"bgr8": (48, 64, 3), "rgba8": (48, 64, 4)}.get(encoding, (48, 64))
    pixels = np.zeros(shape, kinds.get(encoding, np.uint8))
    pixels[10:20] = 200
    image = Image(pixels, encoding, Header(7, "camera"))
    kept, nbytes = packed(image)
    again = kept.unpacked()
    assert nbytes < image.nbytes
    assert (again.header, again.encoding) == (image.header, encoding)
    assert np.abs(again.pixels.astype(float) - pixels).max() <= (
        10 if encoding in ("mono8", "bgr8") else 0
    )


@pytest.fixture
def told():
    return Told(said=Text, image=Image, other=Odometry)


@pytest.fixture
def rewinder(told):
    made = Rewinder(told, lambda: True)
    yield made
    made.close()


def say_all(told, rewinder, count=10, first=0):
    """Publish texts, each when the one before is kept."""
    for number in range(first, first + count):
        before = rewinder.buffer.nbytes
        told.say(said=text(number))
        wait_for(lambda: rewinder.buffer.nbytes > before)  # noqa: B023


def newest(subscription):
    found = None
    while (message := subscription.take(0)) is not None:
        found = message.text
    return found


def test_back_and_to_the_present_again(told, rewinder):
    shown = rewinder.subscribe("/said", 100)
    wait_for(lambda: told.asked["/said"] == 2)  # one to keep
    say_all(told, rewinder)
    assert newest(shown) == "9"
    epoch = shown.epoch
    places = rewinder.buffer._places_ns
    rewinder.seek(places[3] / NS, paused=True)
    assert shown.take(60).text == "3"
    assert shown.epoch > epoch
    told.say(said=text(10))
    assert shown.take(0.01) is None
    rewinder.seek(places[5] / NS)
    assert shown.take(60).text == "5"
    rewinder.past.step()
    assert shown.take(60).text == "6"
    epoch = shown.epoch
    rewinder.leave_past()
    wait_for(lambda: newest(shown) == "10")
    assert shown.epoch > epoch


def test_the_present_comes_by_itself_at_the_end(told, rewinder):
    shown = rewinder.subscribe("/said", 100)
    wait_for(lambda: told.asked["/said"] == 2)
    say_all(told, rewinder)
    rewinder.seek(0.0)
    rewinder.past.set_rate(100)
    wait_for(lambda: rewinder.past is None)
    told.say(said=text(77))
    wait_for(lambda: newest(shown) == "77")


def test_only_topics_with_texts_or_that_are_shown_are_kept(told, rewinder):
    shown = rewinder.subscribe("/image")
    wait_for(lambda: told.asked["/image"] == 2)
    wait_for(lambda: told.asked["/said"] == 1)
    assert not told.asked["/other"]
    shown.close()
    wait_for(lambda: "/image" not in rewinder._kept)
    told.say(image=Image(np.zeros((4, 4), np.uint8), "mono8"))
    assert rewinder.buffer.nbytes == 0


def test_the_timeline_of_a_live_graph(told, rewinder):
    clock = PageClock()
    clock.show(rewinder)
    shown = rewinder.subscribe("/said", 100)
    wait_for(lambda: told.asked["/said"] == 2)
    say_all(told, rewinder, 5)
    with HubClient(clock) as browser, HubClient(clock, is_viewer=True) as viewer:
        state = browser.read_until(lambda state: state["duration"] > 0)
        assert (state["live"], state["past"], state["playing"]) == (True, False, True)
        viewer.send(seek=0)
        browser.send(toggle=1)  # this graph has no playback: its last moment stands still
        browser.read_until(lambda state: state["past"] and not state["playing"])
        browser.send(seek=rewinder.buffer._places_ns[1] / NS)
        browser.read_until(lambda state: state["stamp"] == 1)
        browser.send(rate=2.0)
        browser.read_until(lambda state: state["rate"] == 2)
        browser.send(live=1)
        browser.read_until(lambda state: not state["past"])
        browser.send(seek="x")
        browser.send(live={})
    clock.show(None)
    clock.close()
    assert shown.topic == "/said"
