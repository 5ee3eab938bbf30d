"""A Zenoh network for tests, on this machine alone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ports import free_port

from ros_visualise.runtime.zenoh.session import Endpoints
from ros_visualise.runtime.zenoh.transport import ZenohTransport


def free_address() -> str:
    """An address that nobody listens on."""
    return f"tcp/127.0.0.1:{free_port()}"


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
