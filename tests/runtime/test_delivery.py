"""Whoever fails at the end of a topic, or behind it, takes nobody else with it."""

import weakref
from functools import partial

import numpy as np
import pytest
from test_joined_nodes import boxes_of, diamond, joined
from test_local import FRAMES, CounterParams, Run, _Counter, add, graph_of
from waiting import wait_for

from ros_visualise.core.errors import UsageError
from ros_visualise.core.supervision import PROCESS
from ros_visualise.core.synchronizer import Approximate, Exact, Latest
from ros_visualise.data import Image, PoseArray
from ros_visualise.graph import Graph, place
from ros_visualise.nodes import node, source
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback


class Broken:
    """A consumer that fails at everything it is asked."""

    def __init__(self, error=OSError):
        self.error = error
        self.asked = 0

    def fail(self, *_):
        self.asked += 1
        raise self.error("out")

    put = close = fail


def failures(who):
    """What was noted of somebody, and forgotten by that."""
    found = {one.kind: count for one, count in PROCESS.failures.items() if one.who == who}
    assert len(found) == len(PROCESS.failures), PROCESS.failures
    PROCESS.forget()
    return found


def take_all(run, topic):
    """Collects the numbers of all images of a topic."""
    taken = []

    class Taker:
        def put(self, packet):
            if packet.message is not None:
                taken.append(int(packet.message.pixels[0, 0]))

        def close(self):
            taken.append("end")

    run.runtime.topic(topic).connect(Taker())
    return taken


@pytest.mark.parametrize("error", [OSError, SystemExit])
@pytest.mark.parametrize("topic", ["/image_raw", "/add/sum"])
def test_a_consumer_that_fails_costs_nobody_else_a_message(topic, error, caplog):
    run = Run(graph_of(add))
    broken = Broken(error)
    run.runtime.topic(topic).connect(broken)
    taken = take_all(run, topic)
    report = run.to_the_end()
    of_node = topic == "/add/sum"  # which adds one, and has a word at the end
    assert taken == [*range(of_node, FRAMES + of_node), "end"]
    assert report.nodes["add"].processed == FRAMES
    assert failures(f"listener on {topic}") == {error.__name__: FRAMES + of_node + 1}
    assert len(caplog.messages) == 1
    assert "test_delivery.py" in caplog.messages[0]


def test_a_consumer_that_cannot_tell_whether_it_wants_messages_is_one_that_does():
    run = Run(graph_of(add))
    run.runtime.topic("/add/sum").connect(Broken(), wants=Broken().fail)
    assert run.runtime.topic("/add/sum").awaited
    run.to_the_end()
    assert failures("listener on /add/sum") == {"OSError": FRAMES + 3}


def test_whoever_connects_later_may_fail_too():
    run = Run(graph_of(add))
    run.to_the_end()
    broken = Broken()
    run.runtime.topic("/add/sum").connect(broken, latched=True)
    assert broken.asked == 2
    assert failures("listener on /add/sum") == {"OSError": 2}


def test_who_publishes_from_outside_hears_what_a_listener_refuses():
    @node("takes", inputs={"image": Image}, outputs={"image": Image})
    def takes(image, params):
        return image

    declared = takes.declared
    graph = Graph(None, (place(declared, {"image": "/in"}, {"image": "/out"}),))
    runtime = LocalRuntime(graph, None)
    late = Broken()
    runtime.topic("/in").connect(Broken(partial(UsageError, "tipped over:")))
    runtime.topic("/in").connect(late)
    taken = runtime.subscribe("/out")
    runtime.start()
    with pytest.raises(UsageError, match="tipped over"):
        runtime.publish("/in", Image(np.zeros((1, 1), np.uint8), "mono8"))
    wait_for(lambda: taken.take(0.1))
    assert not late.asked
    runtime.stop()


class Death(BaseException):
    """Ends a thread, whatever its nodes are caught by."""


def dying(at):
    """Finds something in some images, and takes its thread with it."""

    @node("finder", inputs={"image": Image}, outputs={"boxes": PoseArray})
    def find(image, params):
        if image.pixels[0, 0] == at:
            raise Death
        return boxes_of(image)

    return find


def test_a_node_whose_thread_dies_is_heard_and_ends_what_it_publishes():
    @node("dies", inputs={"image": Image}, outputs={"image": Image})
    def dies(image, params):
        if image.pixels[0, 0] == 5:
            raise Death
        return image

    run = Run(graph_of(dies, add))
    taken = take_all(run, "/add/sum")
    report = run.to_the_end()
    assert taken == [1, 2, 3, 4, 5, "end"]
    assert report.topics["/image_raw"].messages == FRAMES
    assert run.runtime.failed
    dead = report.nodes["dies"]
    assert (dead.received, dead.processed) == (FRAMES, 5)
    assert dead.dropped == {"error": FRAMES - 5}
    assert failures("dies") == {"Death": 1}


@pytest.mark.parametrize("join", [Exact(), Approximate(0.01), Latest("image"), Latest("boxes")])
def test_a_join_hoards_nothing_for_an_input_that_has_died(join):
    held = weakref.WeakSet()

    @source("counter", params=CounterParams, outputs={"image": Image})
    class Watched(_Counter):
        def messages(self):
            for port, image in super().messages():
                held.add(image)
                yield port, image

    got = []
    graph = diamond(dying(5), joined(join, got), Watched)
    playback = Playback(rate=0, hold=True)
    runtime = LocalRuntime(graph, playback)
    runtime.start()
    wait_for(lambda: playback.state.ended)
    wait_for(lambda: runtime.report().nodes["joined"].received == FRAMES + 5)
    waiting = len(held)
    runtime.stop()
    assert waiting <= 3  # the last of the topic, of the inbox, and of the join
    assert got[:4] == [(number, number) for number in range(4)] or isinstance(join, Latest)
    assert failures("finder") == {"Death": 1}


def test_what_a_dead_input_leaves_unmatched_is_counted():
    got = []
    runtime = LocalRuntime(diamond(dying(5), joined(Exact(), got)), Playback(rate=0))
    runtime.start()
    assert runtime.wait(20)
    runtime.stop()
    assert got == [(number, number) for number in range(5)]
    assert runtime.report().nodes["joined"].dropped == {"unmatched image": FRAMES - 5}
    assert failures("finder") == {"Death": 1}


def test_a_join_behind_a_dead_node_holds_up_no_recording(tmp_path):
    got = []
    runtime = LocalRuntime(diamond(dying(5), joined(Exact(), got)), Playback(rate=0, hold=True))
    recording = runtime.start_recording(tmp_path / "r.mcap", topics=["/image_raw", "/joined"])
    runtime.start()
    wait_for(lambda: recording.written == FRAMES + 5)  # while the source holds at its end
    runtime.stop()
    assert failures("finder") == {"Death": 1}
