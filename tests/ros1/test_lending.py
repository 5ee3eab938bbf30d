"""Large messages by memory that the subscriber lends, within one process and between several."""

import gc
import os
import signal
import struct
import threading
from typing import Any

import numpy as np
import pytest
from pair import SIZE, Pair, lent
from peer import is_whole, numbered
from peers import Peer, Peers, connect
from ros_graph import wait_for
from sensor_msgs.msg import Image

from ros_visualise.runtime.ros1 import same_host, shared_memory
from ros_visualise.runtime.ros1.receiver import BrokenStream
from ros_visualise.runtime.ros1.shared_memory import FILLED
from ros_visualise.runtime.ros1.topics import Ros1Publisher, Ros1Subscriber
from ros_visualise.runtime.ros1.wire import decode, encode

LARGE = shared_memory.LARGE + 1000


@pytest.fixture
def pair(monkeypatch):
    monkeypatch.setattr(shared_memory, "LARGE", SIZE)
    pair = Pair()
    yield pair
    pair.close()


@pytest.fixture
def peers(ros_master):
    peers = Peers(ros_master)
    yield peers
    peers.stop()


@pytest.fixture
def publisher(ros_master, request):
    publisher = Ros1Publisher(f"/lending/{request.node.name.partition('[')[0]}", Image)
    yield publisher
    publisher.close()


def open_files() -> int:
    return len(os.listdir("/proc/self/fd"))


@pytest.mark.parametrize("data", [np.arange(SIZE) % 253, np.arange(3 * SIZE // 2) % 7])
def test_the_same_bytes_come_either_way(pair, data):
    pixels = data.astype(np.uint8)
    message = Image(height=2, width=3, encoding="mono8", step=9, data=pixels)
    message.header.frame_id = "camera"
    pair.meet()
    pair.outbox.offer(encode(message, 7))
    body = pair.stream.receive()
    assert lent() > 0
    assert body.tobytes() == b"".join(encode(message, 7).buffers)[4:]
    found = decode(body, Image)
    np.testing.assert_array_equal(found.data, pixels)
    found.data = message.data = b""
    assert found == message


def test_what_is_kept_stays_as_it_was_in_few_blocks(pair):
    pair.meet()
    addresses, kept = set(), []
    for number in range(1, 101):
        pair.offer(number)
        kept.append(pair.take())
        del kept[:-3]
        addresses.add(kept[-1].data.ctypes.data)
        assert all((one.data == one.header.seq).all() for one in kept)
    assert len(addresses) <= 8
    assert lent() < 8 * 2 * 2 * SIZE  # mapped by both ends, with some room


def test_whoever_keeps_all_gets_all(pair):
    pair.meet()
    kept = []
    for number in range(1, 61):
        pair.offer(number)
        kept.append(pair.take())
    assert [one.header.seq for one in kept] == list(range(1, 61))
    assert all((one.data == one.header.seq).all() for one in kept)
    kept.clear()
    pair.meet()
    assert lent() < 16 * SIZE


@pytest.mark.parametrize("size", [SIZE + 1000, 4 * SIZE, SIZE // 4, 2 * SIZE])
def test_messages_of_another_size_come(pair, size):
    pair.meet()
    for number, length in enumerate([size, SIZE, size, size, size, 10, SIZE, 3 * SIZE], 1):
        pair.offer(number, length)
        assert pair.take().data.nbytes == length
    pair.meet(size if size > SIZE else SIZE)


def test_a_message_waits_for_who_has_no_time_and_gives_way_to_a_newer_one(pair):
    pair.meet()
    assert [pair.offer(number) for number in (1, 2, 3, 4)] == [False, True, True, True]
    assert pair.outbox.is_full
    assert pair.read() == 4
    assert pair.outbox.flush(60)
    assert not pair.outbox.is_full


def test_who_comes_and_lends_nothing_holds_up_nobody(pair):
    pair.offer(1)
    beside = same_host.connect(pair.there)
    assert beside is not None
    assert [pair.offer(number) for number in (2, 3, 4)] == [False, True, True]
    beside.close()
    assert [pair.read(), pair.read()] == [1, 4]
    assert lent() == 0


def test_nobody_lends_to_another_user(pair, monkeypatch):
    own = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: own + 1)
    for number in range(1, 10):
        pair.offer(number)
        assert pair.read() == number
    assert lent() == 0


@pytest.mark.parametrize("when", ["from the first", "later"])
def test_without_memory_to_lend_messages_come_all_the_same(pair, monkeypatch, when):
    def none(*_: Any) -> int:
        raise OSError("no memory")

    if when == "later":
        pair.meet()
    monkeypatch.setattr(os, "memfd_create", none)
    kept = []
    for number in range(1, 10):
        pair.offer(number)
        kept.append(pair.take())
    assert [one.header.seq for one in kept] == list(range(1, 10))


def test_memory_that_was_not_lent_is_refused(pair):
    pair.meet()
    pair.connection.socket.sendall(struct.pack("<IQ", FILLED + SIZE, 99))
    with pytest.raises(BrokenStream, match="unknown shared memory 99"):
        pair.stream.receive()


def test_nothing_is_left_of_a_connection(monkeypatch):
    monkeypatch.setattr(shared_memory, "LARGE", SIZE)
    gc.collect()
    before = open_files()
    for _ in range(5):
        pair = Pair()
        pair.meet()
        pair.offer(4)
        kept = pair.take()
        pair.close()
        assert (kept.data == 4).all()
        del pair, kept
    gc.collect()
    assert lent() == 0
    wait_for(lambda: gc.collect() or open_files() <= before + 1, "all to be closed")


def test_a_wait_for_memory_ends_with_the_connection(pair):
    pair.meet()
    pair.offer(1)
    threads = [one for one in threading.enumerate() if "/viewer" in one.name]
    assert threads
    pair.connection.close()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive()


def publish_to(publisher: Ros1Publisher, number: int, peers: list[Peer]) -> None:
    publisher.publish(numbered(number, LARGE))
    wait_for(lambda: all(one.numbers[-1:] == [number] for one in peers), "all to get it")


def test_stock_nodes_and_ours_get_the_same(publisher, peers):
    kinds = ("ours", "ours", "rospy")
    all_three = [peers.start("subscribe", by, publisher.name) for by in kinds]
    connect(publisher, 3)
    for number in range(1, 8):
        publish_to(publisher, number, all_three)
    ours, other, stock = all_three
    assert ours.told == other.told == stock.told == [[n, n, LARGE, True] for n in range(1, 8)]
    assert lent(ours.process.pid) > 0
    assert lent(other.process.pid) > 0
    assert lent(stock.process.pid) == 0


def test_a_subscriber_that_is_killed_or_stopped_holds_up_nobody(publisher, peers):
    killed, stopped, other = (peers.start("subscribe", "ours", publisher.name) for _ in range(3))
    connect(publisher, 3)
    for number in range(1, 5):
        publish_to(publisher, number, [killed, stopped, other])
    stopped.signal(signal.SIGSTOP)
    killed.signal(signal.SIGKILL)
    killed.wait()
    for number in range(5, 12):
        publisher.publish(numbered(number, LARGE))
        wait_for(lambda n=number: other.numbers[-1] == n, "the other")
    connect(publisher, 2)
    stopped.signal(signal.SIGCONT)
    wait_for(lambda: stopped.numbers[-1] == 11, "the newest message")
    assert stopped.numbers == sorted(set(stopped.numbers))


def test_a_publisher_that_is_killed_leaves_what_it_has_sent(ros_master, peers):
    got: list[Image] = []
    subscriber = Ros1Subscriber("/lending/by_the_killed", Image, got.append)
    first = peers.start("publish", "ours", subscriber.name, LARGE, 50)
    wait_for(lambda: len(got) > 8, "some messages")
    assert lent() > 0
    first.signal(signal.SIGKILL)
    first.wait()
    wait_for(lambda: subscriber.connections == 0, "the publisher to be gone")
    count = len(got)
    peers.start("publish", "ours", subscriber.name, LARGE, 50)
    wait_for(lambda: len(got) > count + 8, "the next publisher")
    subscriber.close()
    assert all(map(is_whole, got))
    got.clear()
    wait_for(lambda: gc.collect() or lent() == 0, "the memory to be given back")
