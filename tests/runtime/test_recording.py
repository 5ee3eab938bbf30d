"""The order in which a recorder writes, and what it does when it cannot."""

import threading
from pathlib import Path

import numpy as np
import pytest
from waiting import wait_for

from ros_visualise.core.errors import DamagedMessage, RecordingError, UsageError
from ros_visualise.data import Header, Image, ParameterEvent
from ros_visualise.graph import Graph, Node, SourceNode
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.nodes import SourceType
from ros_visualise.nodes.fps_control import FpsControl, FpsParams
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.queues import END, Packet
from ros_visualise.runtime.recording import RecorderThread
from ros_visualise.sources.playback import Playback


class Memory:
    """A recorder that keeps what it is given."""

    path = Path("memory")
    topics = ("/c", "/a", "/b")
    files = 1

    def __init__(self, room=1000):
        self.entries = []
        self.closed = 0
        self.room = room
        self.go_on = threading.Event()
        self.go_on.set()

    def write(self, topic, message, log_ns=None):
        self.go_on.wait(10)
        if len(self.entries) == self.room:
            raise RecordingError("memory: full")
        self.entries.append((topic, message.header.stamp_ns))

    def close(self, whole=True):
        self.closed += 1


def chain(*topics):
    declared = FpsControl.declared
    nodes = [
        Node(topic, declared, FpsParams(), {"image": "/in"}, {"image": topic}) for topic in topics
    ]
    return Graph(None, tuple(nodes))


GRAPH = chain("/a", "/b", "/c")


def packet(number, empty=False, shape=(1, 1)):
    image = Image(np.zeros(shape, np.uint8), "mono8", Header(number * 10))
    return Packet(number, None if empty else image, 0)


def test_nothing_is_recorded_once_the_run_has_ended(tmp_path):
    runtime = LocalRuntime(image_pipeline("landscape"), Playback(rate=0, frames=2))
    runtime.start()
    assert runtime.wait(20)
    runtime.stop()
    with pytest.raises(UsageError, match=r"late\.mcap: the run has ended"):
        runtime.start_recording(tmp_path / "late.mcap")
    assert not list(tmp_path.iterdir())


def test_it_writes_by_number_and_then_by_the_order_of_the_nodes():
    memory = Memory()
    recording = RecorderThread(memory, GRAPH, lossless=True)
    for topic in ("/c", "/b", "/a"):
        for number in range(3):
            recording.put(topic, packet(number, empty=topic == "/b" and number == 1))
    for topic in recording.topics:
        recording.finish(topic)
    recording.close()
    expected = [("/a", 0), ("/b", 0), ("/c", 0), ("/a", 10), ("/c", 10)]
    expected += [("/a", 20), ("/b", 20), ("/c", 20)]
    assert memory.entries == expected
    assert (recording.written, recording.dropped, memory.closed) == (8, 0, 1)


def test_however_the_threads_run_the_order_is_the_same():
    rng = np.random.default_rng(3)
    seen = set()
    for _ in range(20):
        memory = Memory()
        recording = RecorderThread(memory, GRAPH, lossless=True)

        def publish(topic, pauses, recording=recording):
            for number, pause in enumerate(pauses):
                threading.Event().wait(pause)
                recording.put(topic, packet(number, empty=topic == "/c" and number % 3 > 0))
            recording.finish(topic)

        threads = [
            threading.Thread(target=publish, args=(topic, rng.uniform(0, 0.001, 12)))
            for topic in recording.topics
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        recording.close()
        seen.add(tuple(memory.entries))
    assert len(seen) == 1
    assert len(seen.pop()) == 12 + 12 + 4


@pytest.mark.parametrize("early", ["/a", "/b", "/c"])
def test_what_nodes_say_at_the_end_comes_last_however_the_threads_run(early):
    memory = Memory()
    recording = RecorderThread(memory, GRAPH, lossless=True)
    last = Packet(END, packet(9).message, 0)
    for topic in (early, *(t for t in ("/c", "/b", "/a") if t != early)):
        recording.put(topic, packet(0))
        recording.put(topic, packet(1, empty=topic == early))
        recording.put(topic, last)
        recording.finish(topic)
    recording.close()
    whole = [(topic, number) for number in (0, 10, 90) for topic in ("/a", "/b", "/c")]
    assert memory.entries == [entry for entry in whole if entry != (early, 10)]


def test_what_is_pending_is_written_when_it_is_stopped():
    memory = Memory()
    recording = RecorderThread(memory, GRAPH, lossless=True)
    recording.put("/a", packet(0))
    recording.put("/a", packet(1))
    recording.put("/b", packet(0))
    recording.close()
    assert memory.entries == [("/a", 0), ("/b", 0), ("/a", 10)]


def test_a_slow_disk_drops_and_counts_what_a_live_source_gives():
    memory = Memory()
    memory.go_on.clear()
    recording = RecorderThread(memory, chain("/a"), lossless=False)
    for number in range(100):
        recording.put("/a", packet(number, shape=(4000, 8000)))
    memory.go_on.set()
    recording.close()
    assert recording.dropped > 0
    assert recording.written + recording.dropped == 100
    assert [stamp for _, stamp in memory.entries] == sorted(s for _, s in memory.entries)


def test_a_full_disk_ends_the_recording_and_holds_up_nobody(caplog):
    memory = Memory(room=2)
    recording = RecorderThread(memory, chain("/a"), lossless=True)
    for number in range(100):
        recording.put("/a", packet(number))
    recording.close()
    assert str(recording.error) == "memory: full"
    assert (len(memory.entries), memory.closed) == (2, 1)
    assert caplog.messages == ["memory: full"]


def test_what_the_file_cannot_hold_is_counted_and_said_once_for_each_topic(caplog):
    class Refusing(Memory):
        def write(self, topic, message, log_ns=None):
            raise DamagedMessage("no room for it")

    recording = RecorderThread(Refusing(), chain("/a", "/b"), lossless=True)
    for number in range(100):
        recording.put("/a", packet(number))
        recording.put("/b", packet(number))
    recording.close()
    assert (recording.written, recording.dropped) == (0, 200)
    said = [
        f"memory: {topic}: message rejected: no room for it (further occurrences suppressed)"
        for topic in ("/a", "/b")
    ]
    assert sorted(caplog.messages) == said


def test_a_bug_in_a_recorder_ends_the_recording_and_holds_up_nobody(caplog):
    memory = Memory()
    memory.write = lambda *_: 1 / 0
    recording = RecorderThread(memory, chain("/a"), lossless=True)
    for number in range(100):
        recording.put("/a", packet(number))
    recording.close()
    assert isinstance(recording.error, RecordingError)
    assert memory.closed == 1
    assert "ZeroDivisionError" in caplog.text


@pytest.mark.parametrize("messages", [0, 2])
def test_parameters_are_recorded_in_their_place(messages):
    memory = Memory()
    memory.topics = ("/a",)
    recording = RecorderThread(memory, GRAPH, lossless=True)
    recording.put_event(ParameterEvent("a", new={"fps": 30}))
    for number in range(messages):
        recording.put("/a", packet(number + 1))
    recording.close()
    images = [("/a", 10 * (number + 1)) for number in range(messages)]
    assert memory.entries == [("/parameter_events", 10 if messages else 0), *images]


def test_a_camera_s_password_is_not_recorded():
    memory, written = Memory(), []
    memory.topics = ("/a",)
    memory.write = lambda topic, message, stamp_ns=None: written.append(message)
    recording = RecorderThread(memory, GRAPH, lossless=True)
    uri = "http://me:geheim@10.0.0.5/video?user=me&pwd=geheim"
    recording.put_event(ParameterEvent("a", new={"uri": uri, "fps": 30}))
    recording.put_event(ParameterEvent("a", changed={"uri": uri}))
    recording.close()
    shown = "http://me:***@10.0.0.5/video?***"
    assert [(one.new, one.changed) for one in written] == [
        ({"uri": shown, "fps": 30}, {}),
        ({}, {"uri": shown}),
    ]


def sensors():
    """Two topics of a source, and a node behind one of them."""
    made = SourceType("sensors", None, None, {"a": Image, "b": Image})
    source = SourceNode("sensors", made, None, {}, {"a": "/a", "b": "/b"})
    behind = Node("c", FpsControl.declared, FpsParams(), {"image": "/a"}, {"image": "/c"})
    return Graph(source, (behind,))


def test_a_node_owes_no_answer_to_what_does_not_come_to_it():
    memory = Memory()
    recording = RecorderThread(memory, sensors(), lossless=True)
    recording.put("/a", packet(0))
    recording.put("/b", packet(1))
    recording.put("/b", packet(2))
    recording.put("/a", packet(3))
    recording.put("/c", packet(0))
    wait_for(lambda: recording.written == 4, "all that nothing can come before any more")
    assert memory.entries == [("/a", 0), ("/c", 0), ("/b", 10), ("/b", 20)]
    recording.put("/c", packet(3))
    for topic in recording.listeners:
        recording.finish(topic)
    recording.close()
    assert memory.entries[4:] == [("/a", 30), ("/c", 30)]


def test_what_is_not_recorded_still_tells_who_owes_an_answer():
    memory = Memory()
    memory.topics = ("/b", "/c")
    recording = RecorderThread(memory, sensors(), lossless=True)
    recording.put("/a", packet(0))
    recording.put("/b", packet(1))
    recording.put("/c", packet(0))
    for topic in recording.listeners:
        recording.finish(topic)
    recording.close()
    assert memory.entries == [("/c", 0), ("/b", 10)]


def test_a_node_that_is_ahead_of_the_source_s_word_is_not_waited_for_twice():
    memory = Memory()
    recording = RecorderThread(memory, sensors(), lossless=True)
    recording.put("/c", packet(0))
    recording.put("/a", packet(0))
    wait_for(lambda: recording.written == 2)
    recording.close()
    assert memory.entries == [("/a", 0), ("/c", 0)]
