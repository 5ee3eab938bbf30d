"""A Zenoh network for tests, on this machine alone."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager

from ros_visualise.runtime.zenoh.session import Endpoints
from ros_visualise.runtime.zenoh.transport import ZenohTransport


def free_address() -> str:
    """An address that nobody listens on."""
    with socket.create_server(("127.0.0.1", 0)) as made:
        return f"tcp/127.0.0.1:{made.getsockname()[1]}"


class ZenohNet:
    """A network around a node that listens; see `join`."""

    def __init__(self, address: str) -> None:
        self.address = address

    def join(self, name: str) -> ZenohTransport:
        """Another node of the network."""
        return ZenohTransport(name, Endpoints(connect=[self.address]))


@contextmanager
def zenoh_net() -> Iterator[ZenohNet]:
    """A network until the end of the block."""
    address = free_address()
    listening = ZenohTransport("router", Endpoints(listen=[address]))
    try:
        yield ZenohNet(address)
    finally:
        listening.close()
