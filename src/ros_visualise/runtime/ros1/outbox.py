"""One subscriber of a topic: it gets the newest message, as fast as it takes them."""

from __future__ import annotations

import socket
import threading
from typing import Any

from ros_visualise.runtime.ros1.wire import Parcel


class Outbox:
    """Stands for a connection of rospy's to one subscriber.

    A message goes straight to the socket as far as that has room; the rest is sent by a thread of
    this connection's own. Meanwhile one message waits, which a newer one replaces.

    Attributes:
        dropped: messages that were replaced.
    """

    def __init__(self, connection: Any) -> None:
        self.dropped = 0
        self._connection = connection
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

    def offer(self, parcel: Parcel) -> None:
        """Send a message now or soon, unless a newer one comes before."""
        with self._changed:
            if self._busy:
                self.dropped += self._waiting is not None
                self._waiting = parcel
                return
            try:
                self._unsent = self._send_now(parcel)
            except (OSError, AttributeError):  # closed by the subscriber, or by us
                self._closed = True
            else:
                self._count(parcel)
                if self._unsent:
                    self._hand_over()
        if self._closed:
            self._connection.close()

    def flush(self, timeout_s: float) -> bool:
        """Wait until all is with the socket; whether that is so."""
        with self._changed:
            return self._changed.wait_for(lambda: self._closed or not self._busy, timeout_s)

    def _send_now(self, parcel: Parcel) -> list[memoryview]:
        """Send what the socket has room for; what is left."""
        try:
            sent = self._connection.socket.sendmsg(parcel.buffers, (), socket.MSG_DONTWAIT)
        except BlockingIOError:
            sent = 0
        return _after(parcel.buffers, sent)

    def _hand_over(self) -> None:
        self._busy = True
        if self._thread is None:
            self._thread = threading.Thread(target=self._send_all, daemon=True)
            self._thread.start()
        self._changed.notify_all()

    def _send_all(self) -> None:
        while (buffers := self._next()) is not None:
            try:
                for buffer in buffers:
                    self._connection.socket.sendall(buffer)
            except (OSError, AttributeError):
                self._connection.close()
                return

    def _next(self) -> list[memoryview] | None:
        """What to send next; None when the connection is closed."""
        with self._changed:
            unsent, self._unsent = self._unsent, []
            while not (unsent or self._closed):
                if self._waiting is not None:
                    unsent, waiting = self._waiting.buffers, self._waiting
                    self._waiting = None
                    self._count(waiting)
                else:
                    self._busy = False
                    self._changed.notify_all()
                    self._changed.wait()
                    unsent, self._unsent = self._unsent, []
            return None if self._closed else unsent

    def _count(self, parcel: Parcel) -> None:
        self._connection.stat_bytes += parcel.size
        self._connection.stat_num_msg += 1

    def _close(self, _: Any) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()


def _after(buffers: list[memoryview], sent: int) -> list[memoryview]:
    """What is left of the buffers when so many bytes are sent."""
    left = []
    for buffer in buffers:
        if sent < buffer.nbytes:
            left.append(buffer[sent:])
        sent = max(sent - buffer.nbytes, 0)
    return left
