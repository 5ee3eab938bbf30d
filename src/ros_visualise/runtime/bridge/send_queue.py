"""Messages that wait to be sent by a thread of their own."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from ros_visualise.core import supervision

T = TypeVar("T")


class SendQueue(Generic[T]):
    """Sends messages on a thread, so that a publisher never waits for a subscriber.

    When the queue is full, the oldest messages are dropped.

    Args:
        name: of the thread.
        send: sends a message, however long that takes.
        room: messages that may wait.
        start: starts the thread, by its work and its name.

    Attributes:
        dropped: messages that had to make room for newer ones.
    """

    def __init__(
        self,
        name: str,
        send: Callable[[T], object],
        room: int,
        start: Callable[[str, Callable[[], None]], Any] = supervision.start,
    ) -> None:
        self.dropped = 0
        self._send, self._room = send, room
        self._waiting: deque[T] = deque()
        self._is_sending = self._closed = False
        self._changed = threading.Condition()
        start(name, self._run)

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return self._closed

    def put(self, message: T) -> None:
        """Have a message sent, unless this is closed."""
        with self._changed:
            if len(self._waiting) >= self._room:
                self._waiting.popleft()
                self.dropped += 1
            self._waiting.append(message)
            self._changed.notify_all()

    def flush(self, timeout_s: float) -> None:
        """Wait until the last message was sent."""
        with self._changed:
            self._changed.wait_for(self._is_idle, timeout_s)

    def wait_for_room(self, timeout_s: float) -> None:
        """Wait until another message has room."""
        with self._changed:
            self._changed.wait_for(
                lambda: self._closed or len(self._waiting) < self._room, timeout_s
            )

    def close(self) -> bool:
        """Send no more; True the first time."""
        with self._changed:
            was_closed, self._closed = self._closed, True
            self._changed.notify_all()
        return not was_closed

    def _is_idle(self) -> bool:
        return self._closed or not (self._waiting or self._is_sending)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._is_sending = False
                self._changed.notify_all()
                self._changed.wait_for(lambda: self._waiting or self._closed)
                if self._closed:
                    return
                self._is_sending = True
                message = self._waiting.popleft()
            supervision.attempt("send", lambda: self._send(message))  # noqa: B023  # at once
