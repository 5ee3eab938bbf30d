"""What is counted of topics and nodes."""

import time
import tracemalloc

import pytest

from ros_visualise.runtime.counters import NodeCounter, TopicCounter

MS = 1_000_000


def test_rates_go_by_the_newest_stamps_however_many_came():
    stats = TopicCounter()
    for number in range(20_000):
        stats.count(number * 10 * MS, 0)
    for number in range(5_000):
        stats.count(200_000 * MS + number * 40 * MS, 0)
    by_stamps, _ = stats.rates(3600)
    assert by_stamps == 25.0
    assert stats.rates(None)[0] == pytest.approx(25_000 / 400, rel=1e-3)


def test_late_stamps_of_a_second_publisher_take_no_time_of_their_own():
    stats = TopicCounter()
    for number in range(1000):
        stats.count(number * 20 * MS, 0)
        stats.count(number * 20 * MS - 150 * MS, 0)
    assert stats.rates(None)[0] == pytest.approx(100, rel=0.01)
    assert stats.rates(3600)[0] == pytest.approx(100, rel=0.01)


def test_no_time_passes_between_two_epochs():
    stats = TopicCounter()
    for epoch in range(3):
        for number in range(10):
            stats.count(epoch * 1000 * MS + number * 100 * MS, epoch)
    assert stats.rates(None)[0] == 10.0


def test_a_stamp_that_is_no_time_is_counted():
    stats = TopicCounter()
    for stamp_ns in (0, 100 * MS, 2**70, -(2**70)):
        stats.count(stamp_ns, 0)
    assert stats.messages == 4
    stats.rates(3600)


def test_counting_takes_no_more_memory_as_time_goes_by():
    topic, node = TopicCounter(), NodeCounter()
    now_ns = time.monotonic_ns()
    tracemalloc.start()
    try:
        for number in range(10_000):
            topic.count(now_ns + number * MS, 0)
            node.answered(now_ns, now_ns)
        of_counters = tracemalloc.Filter(True, "*/runtime/counters.py")  # no other threads
        found = tracemalloc.take_snapshot().filter_traces([of_counters])
        assert sum(one.size for one in found.traces) < 10_000
    finally:
        tracemalloc.stop()
    assert node.report().processed == topic.messages == 10_000
