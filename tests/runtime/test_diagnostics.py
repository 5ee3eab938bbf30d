"""What was lost in the last second, and not before it; rates above what is kept of the times."""

import time

from ros_visualise.data import Level
from ros_visualise.runtime.counters import TopicCounter
from ros_visualise.runtime.diagnostics import StatusMaker
from ros_visualise.runtime.report import NodeReport


def lost(count):
    return NodeReport(received=count, dropped={"queue": count})


class Clock:
    now_s = 50.0

    def __call__(self):
        return self.now_s


def ask(statuses, count):
    found = statuses.status("/filters", lost(count), {})
    return found.level, found.message


def test_who_asks_first_is_not_told_of_what_was_lost_long_ago():
    clock = Clock()
    statuses = StatusMaker(clock)
    assert ask(statuses, 1000) == (Level.OK, "OK")
    clock.now_s += 1
    assert ask(statuses, 1003) == (Level.WARN, "dropped 3 messages in the last second")
    clock.now_s += 1
    assert ask(statuses, 1003) == (Level.OK, "OK")


def test_nor_is_who_asks_again_after_a_while():
    clock = Clock()
    statuses = StatusMaker(clock)
    ask(statuses, 0)
    clock.now_s += 60
    assert ask(statuses, 500) == (Level.OK, "OK")
    clock.now_s += 1
    assert ask(statuses, 501) == (Level.WARN, "dropped 1 message in the last second")


def test_a_topic_may_be_faster_than_the_times_that_are_kept(monkeypatch):
    now_ns = [10**9]
    monkeypatch.setattr(time, "monotonic_ns", lambda: now_ns[0])
    stats = TopicCounter()
    for number in range(20_000):
        now_ns[0] += 50_000  # 20 kHz
        stats.count(number * 50_000, 0)
    _, wall_hz = stats.rates(1.0)
    assert abs(wall_hz - 20_000) < 20
