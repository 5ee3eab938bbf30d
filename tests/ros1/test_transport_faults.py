"""Peers that stop, die and talk nonsense; ends, and what is published while they come."""

import gc
import os
import signal
import struct
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import rospy
from nav_msgs.msg import Odometry
from peer import is_whole, numbered
from peers import Peers, connect
from ros_graph import wait_for
from rospy.impl.registration import get_topic_manager
from sensor_msgs.msg import Image

from ros_visualise.runtime.ros1.topics import Ros1Publisher, Ros1Subscriber
from ros_visualise.runtime.ros1.wire import Parcel, encode

MEGABYTE = 1_000_000
LARGE = 20_000_000  # what no socket has room for


@pytest.fixture
def peers(ros_master):
    peers = Peers(ros_master)
    yield peers
    peers.stop()


@pytest.fixture
def opened(ros_master):
    """Closes what a test opens."""
    there: list[Any] = []
    yield lambda one: there.append(one) or one
    for one in there:
        one.close()


def numbers(received: list[Image]) -> list[int]:
    assert all(is_whole(message) for message in received)
    return [message.header.stamp.secs for message in received]


@pytest.mark.parametrize("by", ["ours", "rospy"])
def test_a_stopped_subscriber_holds_up_nobody(opened, peers, by):
    publisher = opened(Ros1Publisher(f"/stopped/{by}", Image))
    stopped, quick = (peers.start("subscribe", by, publisher.name) for _ in range(2))
    connect(publisher, 2)
    publisher.publish(numbered(1, MEGABYTE))
    wait_for(lambda: stopped.told and quick.told, "the first message")
    stopped.signal(signal.SIGSTOP)
    for number in range(2, 61):
        publisher.publish(numbered(number, MEGABYTE))
        wait_for(lambda number=number: quick.numbers[-1] == number, "the other to get it")
    assert quick.numbers == list(range(1, 61))
    assert publisher.dropped > 0
    stopped.signal(signal.SIGCONT)
    wait_for(lambda: stopped.numbers[-1] == 60, "the newest message")
    assert len(stopped.numbers) == 60 - publisher.dropped
    assert stopped.numbers == sorted(set(stopped.numbers))
    publisher.publish(numbered(61, MEGABYTE))
    wait_for(lambda: stopped.numbers[-1] == quick.numbers[-1] == 61, "the next message")


def test_a_slow_subscriber_gets_newer_messages_whole(opened, peers):
    publisher = opened(Ros1Publisher("/slowly", Image))
    got: list[Image] = []

    def take(message: Image) -> None:
        time.sleep(0.02)
        got.append(message)

    opened(Ros1Subscriber("/slowly", Image, take))
    connect(publisher)
    for number in range(1, 201):
        publisher.publish(numbered(number, MEGABYTE))
        time.sleep(0.001)
    wait_for(lambda: got and got[-1].header.stamp.secs == 200, "the newest message")
    assert numbers(got) == sorted(set(numbers(got)))
    assert len(got) == 200 - publisher.dropped < 200


def test_a_subscriber_that_is_killed_in_a_message_is_forgotten(opened, peers):
    publisher = opened(Ros1Publisher("/killed", Image))
    peer, other = (peers.start("subscribe", "ours", "/killed") for _ in range(2))
    connect(publisher, 2)
    peer.signal(signal.SIGSTOP)
    publisher.publish(numbered(1, LARGE))
    publisher.publish(numbered(2, LARGE))
    peer.signal(signal.SIGKILL)
    connect(publisher, 1)
    publisher.publish(numbered(3, LARGE))
    wait_for(lambda: other.numbers and other.numbers[-1] == 3, "the other to get the next one")


def test_a_publisher_that_is_killed_in_a_message_is_waited_for(opened, peers):
    got: list[Image] = []
    entered, leave = threading.Event(), threading.Event()

    def take(message: Image) -> None:
        got.append(message)
        entered.set()
        leave.wait(60)

    subscriber = opened(Ros1Subscriber("/comes_again", Image, take))
    first = peers.start("publish", "ours", "/comes_again", LARGE, 100)
    assert entered.wait(60)
    time.sleep(0.2)  # the next one fills the socket
    first.signal(signal.SIGKILL)
    first.wait()
    leave.set()
    wait_for(lambda: subscriber.connections == 0, "the publisher to be gone")
    count = len(got)
    peers.start("publish", "ours", "/comes_again", 1000, 20)
    wait_for(lambda: len(got) > count + 3, "the next publisher")
    assert {len(message.data) for message in got[count:]} == {1000}
    assert numbers(got)[:count]
    assert subscriber.connections == 1


@pytest.mark.parametrize("length", [2**32 - 1, 2**30 + 1])
def test_an_absurd_length_ends_the_connection_with_one_warning(opened, caplog, length):
    publisher, got = talk(opened, f"/absurd_{length}", Image)
    send(publisher, struct.pack("<I", length) + b"nonsense")
    connect(publisher, 0)
    said = [r.getMessage() for r in caplog.records if "announces a message" in r.getMessage()]
    assert len(said) == 1
    assert f"{publisher.name}: the publisher announces a message of {length} bytes" in said[0]
    assert not got


@pytest.mark.parametrize("kind", [Image, Odometry], ids=["large", "small"])
def test_what_is_no_message_is_skipped_with_one_warning(opened, monkeypatch, kind):
    said: list[str] = []
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda period_s, text: said.append(text))
    publisher, got = talk(opened, f"/contradicting/{kind.__name__}", kind)
    message = numbered(1, 100) if kind is Image else Odometry()
    raw = b"".join(encode(message, 1).buffers)
    wrong = raw[:16] + struct.pack("<I", 10**9) + raw[20:]  # the length of frame_id
    send(publisher, wrong)
    publisher.publish(message)
    wait_for(lambda: got, "the message after it")
    assert [message.header.seq for message in got] == [1]
    assert len(said) == 1
    assert f"{publisher.name}: not a message" in said[0]


def talk(opened: Callable[[Any], Any], topic: str, kind: Any) -> tuple[Ros1Publisher, list[Any]]:
    got: list[Any] = []
    opened(Ros1Subscriber(topic, kind, got.append))
    publisher = opened(Ros1Publisher(topic, kind))
    connect(publisher)
    return publisher, got


def send(publisher: Ros1Publisher, raw: bytes) -> None:
    """Bytes that are no message to the only subscriber."""
    [outbox] = get_topic_manager().pubs[publisher.name].connections
    outbox.offer(Parcel([memoryview(raw)], len(raw)))


def test_messages_that_are_kept_stay_as_they_were_in_few_buffers(opened):
    kept: list[Image] = []
    addresses: set[int] = set()
    seen: list[int] = []

    def take(message: Image) -> None:
        kept.append(message)
        del kept[:-3]
        addresses.add(message.data.ctypes.data)
        assert all(map(is_whole, kept))
        seen.append(message.header.stamp.secs)

    opened(Ros1Subscriber("/kept", Image, take))
    publisher = opened(Ros1Publisher("/kept", Image))
    connect(publisher)
    for number in range(1, 201):
        publisher.publish(numbered(number, MEGABYTE))
        wait_for(lambda number=number: seen and seen[-1] == number, "the message")
    assert seen == list(range(1, 201))
    assert len(addresses) <= 8


def test_a_topic_can_be_opened_again_and_again(opened):
    counts, got = [], []
    for number in range(1, 31):
        subscriber = Ros1Subscriber("/again", Image, got.append)
        publisher = Ros1Publisher("/again", Image)
        connect(publisher)
        publisher.publish(numbered(number, 1000))
        wait_for(lambda number=number: len(got) == number, "the message")
        publisher.close()
        subscriber.close()
        subscriber.close()
        publisher.close()
        publisher.publish(numbered(number, 1000))
        publisher.flush(1)
        assert (publisher.connections, publisher.dropped, subscriber.connections) == (0, 0, 0)
        gc.collect()  # rospy itself leaves its pollers to that
        counts.append(open_files())
    assert numbers(got) == list(range(1, 31))
    assert [message.header.seq for message in got] == [1] * 30
    wait_for(lambda: gc.collect() or open_files() <= counts[4] + 5, "all of it to be closed")


def open_files() -> int:
    return len(os.listdir("/proc/self/fd"))


def test_publishing_while_it_is_closed_does_no_harm(opened):
    raised: list[BaseException] = []
    publishers: list[Ros1Publisher] = []
    over = threading.Event()

    def publish() -> None:
        while not over.is_set():
            try:
                for publisher in publishers[-1:]:
                    publisher.publish(numbered(1, 10_000))
            except BaseException as error:
                raised.append(error)

    subscriber = opened(Ros1Subscriber("/closing", Image, lambda message: None))
    threads = [threading.Thread(target=publish) for _ in range(3)]
    for thread in threads:
        thread.start()
    for _ in range(20):
        publishers.append(Ros1Publisher("/closing", Image))
        connect(publishers[-1])
        publishers[-1].close()
        wait_for(lambda: subscriber.connections == 0, "rospy to see that it is gone")
    over.set()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive()
    assert not raised


NODE = """
    import sys, threading, time
    import numpy as np, rospy
    from sensor_msgs.msg import Image
    from ros_visualise.runtime.ros1.topics import Ros1Publisher, Ros1Subscriber

    rospy.init_node("ending")
    publisher = Ros1Publisher("a", Image)
    subscriber = Ros1Subscriber("b", Image, lambda message: None)
    print(publisher.name, subscriber.name, flush=True)

    def publish():
        while True:
            publisher.publish(Image(data=np.zeros(20_000_000, np.uint8)))
            time.sleep(0.01)

    for _ in range(2):
        threading.Thread(target=publish, daemon=True).start()
    input()
    before = publisher.dropped
    while publisher.dropped < before + 3 and not rospy.is_shutdown():
        time.sleep(0.01)
    print("dropped", flush=True)
    if "close" in sys.argv:
        publisher.close()
        subscriber.close()
        print("closed", flush=True)
    else:
        rospy.spin()
"""


@pytest.mark.parametrize("how", ["close", "signal"])
def test_a_node_ends_by_itself_whoever_is_stopped(ros_master, peers, how):
    names = ["a:=/ending/crossed", "b:=/ending/a", "/ending/crossed:=/nowhere"]
    command = [sys.executable, "-c", textwrap.dedent(NODE), how, *names]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    node: Any = subprocess.Popen(command, env=ros_master.environment, **pipes)
    try:
        assert node.stdout.readline() == "/ending/crossed /ending/a\n"  # resolved once
        peer = peers.start("subscribe", "rospy", "/ending/crossed")
        wait_for(lambda: peer.told, "a message")
        peer.signal(signal.SIGSTOP)
        node.stdin.write("\n")
        node.stdin.flush()
        assert node.stdout.readline() == "dropped\n"
        if how == "close":
            assert node.stdout.readline() == "closed\n"
        else:
            node.send_signal(signal.SIGINT)
        assert node.wait(60) == 0
    finally:
        node.kill()
        node.communicate()


def test_data_that_is_not_changed_is_what_arrives(opened):
    publisher, got = talk(opened, "/shared", Image)
    pixels = np.arange(LARGE, dtype=np.uint32).view(np.uint8)
    pixels.flags.writeable = False
    for _ in range(3):
        publisher.publish(Image(data=pixels))
        publisher.flush(60)
    wait_for(lambda: len(got) == 3, "3 messages")
    assert all(np.array_equal(message.data, pixels) for message in got)
