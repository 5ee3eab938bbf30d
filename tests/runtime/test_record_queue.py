"""What waits to be recorded is bounded in bytes and in time, and what has to go is said."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from ros_visualise.data import Header, Image
from ros_visualise.graph import Graph, place
from ros_visualise.nodes import node
from ros_visualise.runtime.ordering import Ordering
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.record_queue import ArrivalQueue, OrderedQueue

MIB = 2**20


class Clock:
    """Monotonic seconds that a test sets."""

    def __init__(self):
        self.now_s = 100.0

    def __call__(self):
        return self.now_s


def packet(number, mib=0.0):
    pixels = np.zeros((1, max(int(mib * MIB), 1)), np.uint8)
    return Packet(number, Image(pixels, "mono8", Header(number)), 0)


def queue():
    clock = Clock()
    return ArrivalQueue(("/a",), "r.mcap", clock=clock), clock


def numbers(one):
    one.stop()
    found = []
    while (taken := one.take()) is not None:
        found.append(taken[1].number)
    return found


def test_topics_are_taken_as_they_came():
    one, _ = queue()
    for number, topic in enumerate(("/b", "/a", "/b", "/c")):
        one.put(topic, packet(number))
    assert [one.take()[0] for _ in range(4)] == ["/b", "/a", "/b", "/c"]
    assert one.dropped == 0


def test_a_moment_without_writing_costs_nothing():
    one, clock = queue()
    for number in range(10):
        one.put("/a", packet(number, 1))
        clock.now_s += 0.025
    assert numbers(one) == list(range(10))
    assert one.dropped == 0


def test_what_cannot_be_written_soon_makes_room_for_newer_messages():
    one, clock = queue()
    for number in range(30):
        one.put("/a", packet(number, 1))
        clock.now_s += 0.1
    assert one.take()[1].number == 26  # of which the four after it wait
    assert one.dropped == 26


def test_a_disk_that_is_too_slow_gets_new_messages():
    """Each has 2 MiB: 25 come a second, of which 10 can be written."""
    one, clock = queue()
    ages_s = []
    for tick in range(500):
        if tick % 4 == 0:
            one.put("/a", packet(tick, 2))
        if tick % 10 == 0:
            ages_s.append((tick - one.take()[1].number) / 100)
        clock.now_s += 0.01
    assert 0.2 < max(ages_s) < 0.4
    assert 60 < one.dropped < 80


def test_small_messages_wait_for_a_disk_that_is_late_also_behind_large_ones():
    one, clock = queue()
    one.put("/image", packet(1000, 20))
    for number in range(200):
        clock.now_s += 0.01
        one.put("/imu", packet(number))
        one.put("/image", packet(1001 + number, 0.25))
    assert [number for number in numbers(one) if number < 1000] == list(range(200))
    assert one.dropped > 100


def test_whatever_the_time_only_so_many_bytes_wait():
    one, _ = queue()
    for number in range(100):
        one.put("/a", packet(number, 1))
    assert len(numbers(one)) == 64


def test_who_can_wait_waits_for_what_is_late():
    one, clock = ordered("/in")
    for number in range(5):
        one.put("/in", packet(number, 1))
    clock.now_s += 1.0
    waiting = threading.Thread(target=one.put, args=("/in", packet(5, 1)))
    waiting.start()
    waiting.join(0.2)
    assert waiting.is_alive()
    assert [one.take()[1].number for _ in range(6)] == list(range(6))
    waiting.join(10)
    assert one.dropped == 0


def test_drops_are_said_at_once_and_then_now_and_then(caplog: pytest.LogCaptureFixture):
    one, clock = queue()
    for number in range(64):
        one.put("/a", packet(number, 1))
    for number in range(64, 300):
        one.put("/a", packet(number, 1))
        clock.now_s += 0.125
    said = "r.mcap: {} dropped so far, as writing is too slow"
    counts = ("1 message", "81 messages", "161 messages")
    assert caplog.messages == [said.format(count) for count in counts]
    assert one.dropped == 236


@node("slow", inputs={"image": Image}, outputs={"image": Image})
def slow(image, params):
    return image


def ordered(*topics):
    graph = Graph(None, (place(slow.declared, {"image": "/in"}, {"image": "/out"}),))
    clock = Clock()
    order = Ordering(chain(graph), topics)
    return OrderedQueue(order, "r.mcap", clock), clock


def chain(graph):
    """Two nodes behind one topic, of which one is slow."""
    other = place(slow.declared, {"image": "/in"}, {"image": "/other"})
    return replace(graph, nodes=(replace(other, name="other"), *graph.nodes))


def test_who_can_wait_waits_for_slow_nodes():
    one, _ = ordered("/other", "/out")
    one.put("/in", packet(0))
    one.put("/other", packet(0))
    for number in (1, 2):
        one.put("/in", packet(number))
    assert one.late_s == 0  # nothing is ready: /out has not answered
    one.put("/out", packet(0))
    one.stop()
    assert [one.take()[0] for _ in range(2)] == ["/other", "/out"]
    assert one.take() is None


def test_what_comes_late_without_a_time_gets_that_of_the_message_before():
    one, _ = queue()
    one.put("/image", packet(3)._replace(log_ns=50))
    one.put("/command", packet(9))
    assert [one.take()[1].log_ns for _ in range(2)] == [50, 50]


def test_messages_of_a_foreign_graph_get_its_time_at_their_arrival():
    times_ns = iter((7, 0))
    one = ArrivalQueue(("/a", "/b"), "r.mcap", lambda: next(times_ns), Clock())
    one.put("/a", packet(3))
    one.put("/b", packet(2))
    assert [one.take()[1].log_ns for _ in range(2)] == [7, 2]


def test_it_ends_with_its_topics():
    one = ArrivalQueue(("/a", "/b"), "r.mcap")
    one.put("/a", packet(3))
    one.finish("/a")
    one.finish("/b")
    assert [one.take()[1].number, one.take()] == [3, None]
