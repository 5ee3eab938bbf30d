"""One subscriber of a topic: it gets the newest message, as fast as it takes them."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from typing import Any

from ros_visualise.core import supervision
from ros_visualise.runtime.ros1.shared_memory import Borrower
from ros_visualise.runtime.ros1.wire import Parcel


class Outbox:
    """Stands for a connection of rospy's to one subscriber.

    A message goes straight to the socket as far as that has room, or to memory that the subscriber
    lends (see `lending`); the rest is sent by a thread of this connection's own. Meanwhile one
    message waits, which a newer one replaces.

    Attributes:
        cleanup_cb: called with this outbox when the connection is closed, by whomever.
    """

    def __init__(self, connection: Any) -> None:
        self.cleanup_cb: Callable[[Outbox], None] | None = None
        self._connection = connection
        self._socket: socket.socket = connection.socket
        self._socket.setblocking(True)  # with a timeout sendmsg would wait, MSG_DONTWAIT or not
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # messages go whole
        self._borrower = Borrower(self._socket)
        self._unsent: list[memoryview] = []
        self._waiting: Parcel | None = None
        self._busy = self._closed = False
        self._thread: threading.Thread | None = None
        self._changed = threading.Condition()
        connection.set_cleanup_callback(self._close)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._connection, name)

    def set_cleanup_callback(self, callback: Callable[[Outbox], None]) -> None:
        """Call a function when the connection is closed."""
        self.cleanup_cb = callback

    def offer(self, parcel: Parcel) -> bool:
        """Send a message now or soon, unless a newer one comes before.

        Returns:
            Whether one that was waiting was dropped for it.
        """
        with self._changed:
            if self._closed:
                return False
            if self._busy:
                replaced, self._waiting = self._waiting, parcel
                return replaced is not None
            if not self._borrower.is_ready(parcel.size):
                self._waiting = parcel
                self._hand_over()
                return False
            try:
                self._unsent = self._send_now(self._borrower.deliver(parcel))
            except OSError:
                pass  # closed below, without the lock
            else:
                self._count(parcel)
                if self._unsent:
                    self._hand_over()
                return False
        self._connection.close()
        return False

    @property
    def is_full(self) -> bool:
        """True if a message waits, which the next one would replace."""
        return self._waiting is not None

    def flush(self, timeout_s: float) -> bool:
        """Wait until all is with the socket; whether that is so."""
        with self._changed:
            return self._changed.wait_for(lambda: self._closed or not self._busy, timeout_s)

    def _send_now(self, buffers: list[memoryview]) -> list[memoryview]:
        """Send what the socket has room for; what is left."""
        try:
            sent = self._socket.sendmsg(buffers, (), socket.MSG_DONTWAIT)
        except BlockingIOError:
            sent = 0
        return _after(buffers, sent)

    def _hand_over(self) -> None:
        self._busy = True
        if self._thread is None:
            name = f"{self._connection.name} to {self._connection.endpoint_id}"
            self._thread = supervision.start(name, self._send_all)
        self._changed.notify_all()

    def _send_all(self) -> None:
        try:
            while self._send_next():
                pass
        except OSError:
            pass  # the subscriber has gone
        finally:
            self._connection.close()

    def _send_next(self) -> bool:
        """Send the message that waits, and forget it; True if there was one."""
        buffers = self._next()
        for buffer in buffers:
            self._socket.sendall(buffer)
        return bool(buffers)

    def _next(self) -> list[memoryview]:
        """The buffers to send next; none when the connection is closed."""
        with self._changed:
            if not self._unsent and self._waiting is None:
                self._busy = False
                self._changed.notify_all()
                self._changed.wait_for(lambda: self._busy or self._closed)
            unsent, self._unsent = self._unsent, []
            size = self._waiting.size if self._waiting is not None else 0
        if unsent or self._closed:
            return [] if self._closed else unsent
        self._borrower.is_ready(size, wait=True)  # a newer one may come meanwhile
        with self._changed:
            newest, self._waiting = self._waiting, None
            if newest is None:
                return []
            self._count(newest)
        return self._borrower.deliver(newest)

    def _count(self, parcel: Parcel) -> None:
        self._connection.stat_bytes += parcel.size
        self._connection.stat_num_msg += 1

    def _close(self, _: Any) -> None:
        with self._changed:
            again, self._closed = self._closed, True  # two threads may close at once
            self._waiting = None
            self._borrower.close()
            self._changed.notify_all()
        if self.cleanup_cb is not None and not again:
            self.cleanup_cb(self)


def _after(buffers: list[memoryview], sent: int) -> list[memoryview]:
    """The buffers without the bytes that were sent."""
    left = []
    for buffer in buffers:
        if sent < buffer.nbytes:
            left.append(buffer[sent:])
        sent = max(sent - buffer.nbytes, 0)
    return left
