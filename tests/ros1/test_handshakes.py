"""Peers that connect and say nothing, or nonsense, keep nobody else away."""

import socket
import struct
import xmlrpc.client
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
from dynamic_reconfigure.msg import Config

NODE = "/filters"
MORE_THAN_WAIT = 20  # connections that nobody has accepted yet


@pytest.fixture
def connect(ros_master, start) -> Iterator[Callable[[bytes], socket.socket]]:
    """Connects to a node that runs, as a subscriber does, and sends something."""
    start("filters")
    _, _, uri = ros_master.proxy().lookupNode("/tests", NODE)
    topic = f"{NODE}/parameter_updates"
    _, _, (_, host, port) = xmlrpc.client.ServerProxy(uri).requestTopic(
        "/tests", topic, [["TCPROS"]]
    )
    with ExitStack() as open_until_the_end:

        def connect(said: bytes) -> socket.socket:
            connection = socket.create_connection((host, port), timeout=60)
            open_until_the_end.enter_context(connection)
            connection.sendall(said)
            return connection

        yield connect


@pytest.mark.parametrize("said", [b"", b"\x20\x00", struct.pack("<I", 2**20) + b"half"])
def test_whoever_does_not_go_on_keeps_nobody_away(connect, hear, said):
    for _ in range(MORE_THAN_WAIT):
        connect(said)
    hear(f"{NODE}/parameter_updates", Config).wait()


def has_ended(connection: socket.socket) -> bool:
    try:
        return connection.recv(1) == b""
    except ConnectionResetError:
        return True


@pytest.mark.parametrize("said", [struct.pack("<I", 2**32 - 1), b"GET / HTTP/1.1\r\n\r\n"])
def test_a_header_that_is_none_ends_its_connection(connect, hear, said):
    assert has_ended(connect(said))
    hear(f"{NODE}/parameter_updates", Config).wait()


def test_who_says_nothing_is_left(connect):
    assert has_ended(connect(b""))
