"""Ports of servers that tests start."""

import random
import socket
from contextlib import suppress

_RANDOM = random.Random()


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    """A port that is free, and that no system gives to somebody else before it is used.

    Systems give ports from 32768 on to those who do not ask for a certain one.
    """
    while True:
        port = _RANDOM.randrange(10_000, 32_000)
        with suppress(OSError), socket.socket(socket.AF_INET, kind) as probe:
            probe.bind(("127.0.0.1", port))
            return port
