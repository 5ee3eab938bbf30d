"""What waits to be sent to browsers: viser's buffer of messages, mended."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import viser
from viser.infra import Message, _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer

_FEW = 64


class _LoopEvent(asyncio.Event):
    """An event that only a running loop sets."""

    def set(self) -> None:
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        super().set()


class _Outbox(AsyncMessageBuffer):
    """Tidies up as soon as a third of it may be messages that something was removed."""

    tidy: Callable[[], None] | None = None

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.message_event = _LoopEvent()
        self._removals = 0

    def push(self, message: Message) -> None:
        super().push(message)
        if self.tidy is None or message.lifecycle_phase != "remove":
            return
        self._removals += 1
        if self._removals > max(_FEW, len(self.message_from_id) // 3):
            self._removals = 0
            self.tidy()


def mend_outboxes() -> None:
    """Let any thread change the pages that are opened from now on: they get these outboxes.

    When a thread changes a page, viser 1.1 sets an `asyncio.Event` from that thread, and again from
    its loop. Events are not made for other threads: now and then the first call raises a
    RuntimeError, as the loop changes the list of waiters meanwhile. The second call is enough.
    """
    _infra.AsyncMessageBuffer = _Outbox  # type: ignore[attr-defined]


def keep_tidy(server: viser.ViserServer) -> None:
    """Let what comes and goes on a page leave nothing behind.

    viser 1.1 keeps a message of each thing that was removed until the next browser connects. What
    all browsers have been told of goes here after every few removals.
    """
    outbox = server._websock_server._broadcast_buffer
    assert isinstance(outbox, _Outbox)
    outbox.tidy = server._run_garbage_collector
