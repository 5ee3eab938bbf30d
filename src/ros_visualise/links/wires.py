"""Ways to a vehicle: UDP, TCP and serial lines, opened again by themselves when they fail.

``udp://:14540`` listens on this machine, ``udp://0.0.0.0:14540`` for others too; answers go to the
address that a system was last heard from. ``udpout://HOST:PORT`` begins, ``tcp://HOST:PORT``
connects, ``serial:///dev/ttyACM0:57600`` opens a device.
"""

from __future__ import annotations

import os
import select
import socket
import termios
import time
import tty
from typing import Protocol
from urllib.parse import urlsplit

from ros_visualise.core.errors import OpenError, UsageError

SYSTEM = "?system="
"""Before the number of one of several vehicles, at the end of an address."""
FORMS = "udp://[HOST]:PORT, udpout://HOST:PORT, tcp://HOST:PORT or serial:///DEVICE:BAUD"
_MOST = 65_536
_AGAIN_S = 1.0  # between two tries to open
_CONNECT_S = 2.0

Peer = tuple[str, int] | None


class Wire(Protocol):
    """An open way; its methods raise OSError when it fails."""

    def read(self, timeout_s: float) -> tuple[bytes, Peer]:
        """The bytes that came, and their sender; none after the timeout."""

    def write(self, data: bytes, peer: Peer) -> None:
        """Send to a peer; None: to all that is known."""

    def close(self) -> None:
        """Close it."""


def parse(address: str) -> tuple[str, str, int]:
    """Scheme, host or device, and port or baud rate; raises UsageError."""
    try:
        parts = urlsplit(address)
        if parts.scheme == "serial":
            device, _, baud = parts.path.rpartition(":")
            if device and hasattr(termios, f"B{int(baud)}"):
                return "serial", device, int(baud)
        elif parts.scheme in ("udp", "udpout", "tcp") and parts.port and not parts.path:
            host = parts.hostname or ("127.0.0.1" if parts.scheme == "udp" else "")
            if host:
                return parts.scheme, host, parts.port
    except ValueError:
        pass
    raise UsageError(f"{address}: not the address of a vehicle; use {FORMS}")


def split_system(address: str) -> tuple[str, int]:
    """An address, and the number of the vehicle's system after it; 0: none.

    Raises:
        UsageError: not an address, or not a number from 1 to 255.
    """
    place, mark, number = address.partition(SYSTEM)
    parse(place)
    if mark and not (number.isascii() and number.isdigit() and 1 <= int(number) <= 255):
        raise UsageError(f"{address}: the system ID must be from 1 to 255")
    return place, int(number or 0)


def open_wire(address: str) -> Wire:
    """Open an address; raises UsageError and OSError."""
    scheme, host, number = parse(address)
    if scheme == "serial":
        return _Serial(host, number)
    if scheme == "tcp":
        return _Tcp(host, number)
    return _Udp(host, number, listens=scheme == "udp")


class Rewire:
    """A wire that is opened again when it fails, at most once a second.

    Args:
        address: as `parse` takes it; the first opening raises OpenError if nothing can come of it.

    Attributes:
        error: why it is closed; empty while it is open.
    """

    def __init__(self, address: str) -> None:
        self.error = ""
        self._address = address
        self._wire: Wire | None = None
        self._next_s = 0.0
        scheme, _, _ = parse(address)
        self._open()
        if self.error and scheme == "udp":
            raise OpenError(f"{address}: {self.error}")

    def read(self, timeout_s: float) -> tuple[bytes, Peer]:
        """The bytes that came, and their sender; none while it is closed."""
        if self._wire is None and time.monotonic() >= self._next_s:
            self._open()
        if self._wire is None:
            time.sleep(timeout_s)
            return b"", None
        try:
            return self._wire.read(timeout_s)
        except OSError as error:
            self._fail(error)
            return b"", None

    def write(self, data: bytes, peer: Peer) -> None:
        """Send, if it is open."""
        try:
            if self._wire is not None:
                self._wire.write(data, peer)
        except (BlockingIOError, TimeoutError):
            pass  # the line is full; what is sent is out of date soon
        except OSError as error:
            self._fail(error)

    def close(self) -> None:
        """Close it for good."""
        if self._wire is not None:
            self._wire.close()

    def _open(self) -> None:
        self._next_s = time.monotonic() + _AGAIN_S
        try:
            self._wire, self.error = open_wire(self._address), ""
        except OSError as error:
            self.error = error.strerror or str(error)

    def _fail(self, error: OSError) -> None:
        self.error = error.strerror or str(error)
        if self._wire is not None:
            self._wire.close()
        self._wire, self._next_s = None, time.monotonic() + _AGAIN_S


class _Udp:
    def __init__(self, host: str, port: int, listens: bool) -> None:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._peers: set[tuple[str, int]] = set()
        try:
            if listens:
                self._socket.bind(address)
            else:
                self._peers.add((str(address[0]), int(address[1])))
        except OSError:
            self._socket.close()
            raise

    def read(self, timeout_s: float) -> tuple[bytes, Peer]:
        self._socket.settimeout(timeout_s)
        try:
            data, peer = self._socket.recvfrom(_MOST)
        except (TimeoutError, ConnectionRefusedError):  # nobody listens there yet
            return b"", None
        self._peers = {*list(self._peers)[-15:], (peer[0], peer[1])}
        return data, (peer[0], peer[1])

    def write(self, data: bytes, peer: Peer) -> None:
        for one in [peer] if peer else list(self._peers):
            self._socket.sendto(data, one)

    def close(self) -> None:
        self._socket.close()


class _Tcp:
    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.create_connection((host, port), _CONNECT_S)

    def read(self, timeout_s: float) -> tuple[bytes, Peer]:
        self._socket.settimeout(timeout_s)
        try:
            data = self._socket.recv(_MOST)
        except TimeoutError:
            return b"", None
        if not data:
            raise ConnectionResetError("closed by the vehicle")
        return data, None

    def write(self, data: bytes, peer: Peer) -> None:
        self._socket.sendall(data)

    def close(self) -> None:
        self._socket.close()


class _Serial:
    def __init__(self, device: str, baud: int) -> None:
        self._file = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(self._file)
            settings = termios.tcgetattr(self._file)
            settings[4] = settings[5] = getattr(termios, f"B{baud}")
            termios.tcsetattr(self._file, termios.TCSANOW, settings)
        except (OSError, termios.error) as error:
            os.close(self._file)
            raise OSError(f"not a serial line ({error})") from None

    def read(self, timeout_s: float) -> tuple[bytes, Peer]:
        if not select.select([self._file], [], [], timeout_s)[0]:
            return b"", None
        data = os.read(self._file, _MOST)
        if not data:
            raise OSError("unplugged")
        return data, None

    def write(self, data: bytes, peer: Peer) -> None:
        os.write(self._file, data)

    def close(self) -> None:
        os.close(self._file)
