"""What one subscriber gets of what is offered to it, over a real socket."""

import gc
import socket
import struct
import threading
import time
import weakref
from typing import Any

import numpy as np
import pytest
from pair import SIZE, Pair
from ros_graph import wait_for
from rospy.impl.transport import OUTBOUND
from sensor_msgs.msg import Image

from ros_visualise.runtime.ros1 import shared_memory
from ros_visualise.runtime.ros1.wire import encode


@pytest.fixture(params=["by the socket", "in memory"])
def pair(request, monkeypatch):
    pair = Pair()
    if request.param == "in memory":
        monkeypatch.setattr(shared_memory, "LARGE", SIZE)
        pair.meet()
    pair.connection.stat_bytes = pair.connection.stat_num_msg = 0
    yield pair
    pair.close()
    wait_for(lambda: not senders(), "its sender to end")


def senders() -> list[threading.Thread]:
    return [one for one in threading.enumerate() if "/viewer" in one.name]


def fill(pair: Pair) -> int:
    """Offer numbered messages to who does not read until one is dropped; how many."""
    for number in range(1, 100):
        if pair.offer(number):
            return number
    return pytest.fail("nothing is ever dropped")


def test_who_does_not_read_gets_the_newest_when_it_reads_again(pair):
    last = fill(pair) + 5
    assert [pair.offer(last - 5 + i) for i in range(1, 6)] == [True] * 5
    numbers = []
    while not numbers or numbers[-1] < last:
        numbers.append(pair.read())
    assert numbers == [*range(1, len(numbers)), last]
    assert len(numbers) == last - 6  # one for each that was dropped
    assert pair.connection.stat_num_msg == len(numbers)
    size = len(b"".join(encode(Image(data=bytes(SIZE)), 1).buffers))
    assert pair.connection.stat_bytes == size * len(numbers)


def test_it_is_full_while_a_message_waits(pair):
    assert not pair.outbox.is_full
    fill(pair)
    assert pair.outbox.is_full
    pair.outbox.close()
    assert not pair.outbox.is_full


def test_who_reads_gets_all(pair):
    for number in range(1, 50):
        assert not pair.offer(number % 250)
        assert pair.read() == number
        assert pair.outbox.flush(60)


def test_small_messages_need_no_thread(pair):
    for number in range(1, 100):
        pair.offer(number, 10)
    assert [pair.read() for _ in range(99)] == list(range(1, 100))
    assert not senders()


def test_flush_waits_for_who_reads_and_not_for_who_does_not(pair):
    assert pair.outbox.flush(0)
    last = fill(pair)
    start_s = time.monotonic()
    assert not pair.outbox.flush(0.05)
    assert time.monotonic() - start_s >= 0.05
    thread = threading.Thread(target=lambda: [None for _ in iter(pair.read, last)])
    thread.start()
    assert pair.outbox.flush(60)
    thread.join(60)
    assert not thread.is_alive()


def test_what_is_published_is_held_until_it_is_sent_and_no_longer(pair):
    fill(pair)
    pixels = np.full(SIZE, 200, np.uint8)
    held = weakref.ref(pixels)
    pair.outbox.offer(encode(Image(data=pixels), 200))
    del pixels
    gc.collect()
    assert held() is not None
    while pair.read() != 200:
        pass
    assert pair.outbox.flush(60)
    wait_for(lambda: held() is None, "the buffer to be let go")


@pytest.mark.parametrize("busy", [True, False], ids=["busy", "idle"])
def test_a_closed_connection_lets_go_of_everything(pair, busy):
    told: list[Any] = []
    pair.outbox.set_cleanup_callback(told.append)
    if busy:
        fill(pair)
    pair.connection.close()
    assert told == [pair.outbox]
    assert pair.outbox.flush(60)
    wait_for(lambda: not senders(), "the sender to end")
    pixels = np.zeros(SIZE, np.uint8)
    held = weakref.ref(pixels)
    assert not pair.outbox.offer(encode(Image(data=pixels), 1))
    del pixels
    assert held() is None
    assert told == [pair.outbox]


@pytest.mark.parametrize("busy", [True, False], ids=["busy", "idle"])
def test_who_goes_away_is_closed(pair, busy):
    if busy:
        fill(pair)
    # with an answer that nothing more is wanted, at once
    pair.there.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    pair.there.close()
    pair.stream.close()
    wait_for(lambda: pair.offer(1) or pair.connection.done, "the outbox to notice")
    wait_for(lambda: pair.connection.done, "the connection to close")
    wait_for(lambda: not senders(), "the sender to end")


def test_what_rospy_asks_is_asked_of_the_connection(pair):
    assert pair.outbox.endpoint_id == "/viewer"
    assert pair.outbox.direction == OUTBOUND
    with pytest.raises(AttributeError):
        pair.outbox.nothing_of_that_name  # noqa: B018
