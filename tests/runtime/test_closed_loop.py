"""A source that is told what nodes make of its own messages, and hears that in order."""

import time
from dataclasses import replace

import numpy as np
import pytest

from ros_visualise.data import Header, Image, PoseStamped
from ros_visualise.graph import Graph, SourceNode, place
from ros_visualise.nodes import NoParams, node, source
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback

COUNT = 25


class Pictures:
    duration_ns = None

    def read(self, start_ns):
        for number in range(COUNT):
            yield number * 100_000_000, Image(np.full((2, 3), number, np.uint8), "mono8")


class Listener:
    """Gives images, and counts how many answers it had heard before each."""

    waits = True

    def __init__(self, params, playback):
        self.playback, self.heard, self.before = playback, 0, []
        LISTENERS.append(self)

    def messages(self):
        for stamp_ns, image in self.playback.run(Pictures()):
            self.before.append(self.heard)
            yield "image", replace(image, header=Header(stamp_ns, "camera"))

    def receive(self, port, message):
        self.heard += 1

    def awaits(self, port):
        return self.waits

    def close(self):
        pass


class Deaf(Listener):
    waits = False


LISTENERS: list[Listener] = []


@node("ponderer", inputs={"image": Image}, outputs={"pose": PoseStamped})
def ponderer(image, params):
    """Answers after a while, to every second image."""
    time.sleep(0.01)
    if image.pixels[0, 0] % 2:
        return None
    return PoseStamped(np.zeros(3), np.array([0.0, 0, 0, 1]), image.header)


def loop_of(cls, answering, rate=0.0):
    declare = source(
        "seer", params=NoParams, inputs={"pose": PoseStamped}, outputs={"image": Image}
    )
    declared = declare(type(cls.__name__, (cls,), {})).declared
    seer = SourceNode("seer", declared, NoParams(), {"pose": "/pose"}, {"image": "/image_raw"})
    answers = place(answering.declared, {"image": "/image_raw"}, {"pose": "/pose"})
    return LocalRuntime(Graph(seer, (answers,)), Playback(rate=rate))


def run(cls, rate=0.0):
    runtime = loop_of(cls, ponderer, rate)
    runtime.start()
    assert runtime.wait(60)
    runtime.stop()
    return LISTENERS[-1]


@pytest.mark.parametrize("rate", [0, 100])
def test_before_its_next_message_it_has_heard_what_was_made_of_the_last(rate):
    listener = run(Listener, rate)
    assert listener.before == [(number + 1) // 2 for number in range(COUNT)]
    assert listener.heard == (COUNT + 1) // 2


def test_where_it_does_not_need_to_hear_it_does_not_wait():
    listener = run(Deaf)
    assert listener.before[-1] < COUNT // 2
    assert listener.heard == (COUNT + 1) // 2


def test_it_ends_while_it_waits():
    @node("mute", inputs={"image": Image}, outputs={"pose": PoseStamped})
    def mute(image, params):
        time.sleep(0.3)

    runtime = loop_of(Listener, mute)
    runtime.start()
    runtime.stop()
    assert runtime.wait(10)
    assert len(LISTENERS[-1].before) < COUNT
