"""Lines: addresses that are read in a thread each, and shared by all who hear messages there."""

from __future__ import annotations

import logging
import threading
from functools import partial
from typing import Any, Protocol

import numpy as np

from ros_visualise.core import supervision
from ros_visualise.links.mavlink import MavlinkStream
from ros_visualise.links.wires import Peer, Rewire

log = logging.getLogger(__name__)

_LOOK_S = 0.02


class Hearer(Protocol):
    """One who hears the messages of a line, in its thread."""

    system: int
    """The system that it follows; 0: none yet."""

    def hear(self, message: Any, line: MavlinkLine, peer: Peer) -> None:
        """Take a message of pymavlink, that came from a peer of a line."""

    def watch(self) -> None:
        """Look at the time, about 50 times a second."""


class MavlinkLine:
    """An address, and those who hear it.

    Attributes:
        address: see `ros_visualise.links.wires`.
        damaged: bytes that belong to no known message.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self.damaged = 0
        self._wire = Rewire(address)
        self._stream = MavlinkStream()
        self._hearers: list[Hearer] = []
        self._said = ""
        self._sending = threading.Lock()
        self._closed = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def error(self) -> str:
        """Reason why it is closed at present; empty: it is open."""
        return self._wire.error

    @property
    def systems(self) -> set[int]:
        """Systems that are followed."""
        return {one.system for one in self._hearers}

    def join(self, hearer: Hearer) -> None:
        """Give the messages to one more."""
        with _OPENING:
            self._hearers = [*self._hearers, hearer]
            if self._thread is None:
                self._thread = supervision.start(f"MAVLink {self.address}", self._run)

    def leave(self, hearer: Hearer) -> None:
        """Give it no more messages; the last one closes the line."""
        with _OPENING:
            self._hearers = [one for one in self._hearers if one is not hearer]
            if not self._hearers and self._thread is not None:
                _LINES.pop(self.address, None)
                self._closed.set()
                self._thread.join()

    def send(self, frame: bytes, peer: Peer) -> None:
        """Send a frame to a peer; None: to all that were heard."""
        with self._sending:
            self._wire.write(frame, peer)

    def _run(self) -> None:
        try:
            with np.errstate(all="ignore"):  # numbers of others are tested where they matter
                while not self._closed.is_set():
                    self._read()
                    for one in self._hearers:
                        one.watch()
                    self._notice_failure()
        finally:
            self._wire.close()

    def _read(self) -> None:
        data, peer = self._wire.read(_LOOK_S)
        is_datagram = peer is not None  # only bytes of a line continue the last ones
        for message in self._stream.feed(data, is_datagram) if data else ():
            for one in self._hearers:
                name = f"{self.address}: {message.get_type()}"
                supervision.attempt(name, partial(one.hear, message, self, peer))
        self.damaged = self._stream.damaged

    def _notice_failure(self) -> None:
        if self.error != self._said:
            self._said = self.error
            if self._said:
                log.warning("%s: %s; trying again", self.address, self._said)


_LINES: dict[str, MavlinkLine] = {}
_OPENING = threading.Lock()


def line_at(address: str) -> MavlinkLine:
    """The line of an address, opened by the first who asks; those who `join` it must `leave` it.

    Raises:
        OpenError: it cannot be opened.
        UsageError: it is no address.
    """
    with _OPENING:
        if address not in _LINES:
            _LINES[address] = MavlinkLine(address)
        return _LINES[address]
