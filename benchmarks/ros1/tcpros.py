"""A subscriber that takes as little of the machine as can be: it reads the head of each message.

It speaks TCPROS by itself, so that it is no part of what is measured. What lies behind the head is
thrown away inside the kernel (MSG_TRUNC), not copied.
"""

import mmap
import socket
import struct
import time
import xmlrpc.client
from dataclasses import dataclass

import rosgraph
import rosgraph.network
from sensor_msgs.msg import Image

_CALLER = "/benchmark"
_HEAD = 512
MARK_BITS = 64
_TRASH = memoryview(mmap.mmap(-1, 1 << 25))


class NothingComes(Exception):
    """Nobody publishes, or no message arrived in time."""


@dataclass(frozen=True)
class Head:
    """An image without its pixels."""

    arrived_ns: int
    stamp_ns: int
    height: int
    width: int
    encoding: str
    first_pixels: bytes

    @property
    def mark_ns(self) -> int:
        """The stamp that the source wrote into the first pixels (see ``source.py``)."""
        step = 3 if self.encoding in ("bgr8", "8UC3") else 1
        bits = self.first_pixels[: MARK_BITS * step : step]
        return sum(1 << place for place, level in enumerate(bits) if level > 64)


class Tap:
    """Connects to the one publisher of a topic.

    Args:
        topic: to listen to.
        patience_s: to wait for the publisher, and later for each message.

    Raises:
        NothingComes: nobody publishes it in time.
    """

    def __init__(self, topic: str, patience_s: float = 15.0) -> None:
        node = _publisher_of(topic, patience_s)
        proxy = xmlrpc.client.ServerProxy(node)
        code, text, where = proxy.requestTopic(_CALLER, topic, [["TCPROS"]])
        if code != 1:
            raise NothingComes(f"{topic}: {text}")
        self._socket = socket.create_connection((where[1], where[2]), timeout=patience_s)
        fields = {
            "callerid": _CALLER,
            "topic": topic,
            "type": Image._type,
            "md5sum": Image._md5sum,
            "tcp_nodelay": "1",
        }
        self._socket.sendall(rosgraph.network.encode_ros_handshake_header(fields))
        self._exactly(self._length())

    def __enter__(self) -> "Tap":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def next(self) -> Head:
        """The next message, when it is here to its end.

        Raises:
            NothingComes: not in time, or the publisher left.
        """
        head, rest = self._begin()
        while rest:
            rest -= self._take(_TRASH[: min(rest, len(_TRASH))], socket.MSG_TRUNC)
        return _parse(head, time.time_ns())

    def next_pixels(self) -> tuple[Head, bytes]:
        """The next message with its pixels."""
        head, rest = self._begin()
        whole = head + self._exactly(rest)
        parsed = _parse(whole, time.time_ns())
        return parsed, whole[-parsed.height * parsed.width :]

    def _begin(self) -> tuple[bytes, int]:
        length = self._length()
        head = self._exactly(min(length, _HEAD))
        return head, length - len(head)

    def _length(self) -> int:
        return int(struct.unpack("<I", self._exactly(4))[0])

    def _exactly(self, length: int) -> bytes:
        buffer = bytearray(length)
        left = memoryview(buffer)
        while left:
            left = left[self._take(left, 0) :]
        return bytes(buffer)

    def _take(self, buffer: memoryview, flags: int) -> int:
        try:
            got = self._socket.recv_into(buffer, len(buffer), flags | socket.MSG_WAITALL)
        except TimeoutError:
            raise NothingComes("no message in time") from None
        if not got:
            raise NothingComes("the publisher left")
        return got


def _publisher_of(topic: str, patience_s: float) -> str:
    master = rosgraph.Master(_CALLER)
    end_s = time.monotonic() + patience_s
    while time.monotonic() < end_s:
        for name, nodes in master.getSystemState()[0]:
            if name == topic:
                return str(master.lookupNode(nodes[0]))
        time.sleep(0.05)
    raise NothingComes(f"nobody publishes {topic}")


def _parse(head: bytes, arrived_ns: int) -> Head:
    _, secs, nsecs, length = struct.unpack_from("<IIII", head)
    at = 16 + length
    height, width, length = struct.unpack_from("<III", head, at)
    at += 12
    encoding = head[at : at + length].decode()
    at += length + 9
    stamp_ns = secs * 10**9 + nsecs
    return Head(arrived_ns, stamp_ns, height, width, encoding, head[at : at + MARK_BITS * 3])
