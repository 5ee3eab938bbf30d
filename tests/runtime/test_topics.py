"""The topics inside a process: what who connects gets, whenever that is."""

import threading
import time

import pytest

from ros_visualise.data import Header, Text
from ros_visualise.runtime import topics
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.runtime.topics import Subscription, Topic


class Listener:
    def __init__(self):
        self.got = []

    def put(self, packet):
        self.got.append(packet.number)

    def close(self):
        pass


def packet(number):
    return Packet(number, Text(str(number), Header(number)), number)


@pytest.mark.parametrize("before", [0, 1])
def test_who_connects_while_a_message_goes_out_gets_it_once_and_last(monkeypatch, before):
    topic, late, threads = Topic("/topic"), Listener(), []
    for number in range(before):
        topic.publish(packet(number))

    class Clock:
        """As if another thread had its turn in the middle of publishing."""

        @staticmethod
        def monotonic():
            if not threads:
                threads.append(threading.Thread(target=topic.connect, args=(late, True)))
                threads[0].start()
                threads[0].join(0.2)
            return time.monotonic()

    monkeypatch.setattr(topics, "time", Clock)
    topic.publish(packet(7))
    threads[0].join()
    assert late.got[-1] == 7
    assert late.got.count(7) == 1


def test_a_latched_message_is_never_missed_nor_followed_by_an_older_one():
    topic, listeners = Topic("/topic"), []
    stop = threading.Event()

    def connect():
        while not stop.is_set():
            listeners.append(Listener())
            topic.connect(listeners[-1], latched=True)
            if len(listeners) % 50 == 0:
                for one in listeners[-50:]:
                    topic.disconnect(one)

    topic.publish(packet(0))
    thread = threading.Thread(target=connect)
    thread.start()
    for number in range(1, 3000):
        topic.publish(packet(number))
    stop.set()
    thread.join()
    assert listeners
    for one in listeners:
        assert one.got == list(range(one.got[0], one.got[0] + len(one.got)))


def test_whoever_looks_on_waits_for_a_message_though_a_node_has_none_for_some_numbers():
    inbox, said = Inbox(lossless=False), threading.Event()
    subscription = Subscription("/topic", inbox, lambda: None)

    def publish():
        said.wait(10)
        inbox.put(Packet(1, None, 1))
        time.sleep(0.05)
        inbox.put(packet(2))

    thread = threading.Thread(target=publish)
    thread.start()
    said.set()
    assert subscription.take(10).text == "2"
    assert subscription.take(0) is None
    thread.join()
