"""Waking viser's event loop, from the loop's own thread alone."""

from __future__ import annotations

import asyncio
from typing import Any

from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer


class _LoopEvent(asyncio.Event):
    """An event that only a running loop sets."""

    def set(self) -> None:
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        super().set()


class _Messages(AsyncMessageBuffer):
    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.message_event = _LoopEvent()


def mend_wakeups() -> None:
    """Let any thread change the pages that are opened from now on.

    When a thread changes a page, viser 1.1 sets an `asyncio.Event` from that thread, and again from
    its loop. Events are not made for other threads: now and then the first call raises a
    RuntimeError, as the loop changes the list of waiters meanwhile. The second call is enough.
    """
    _infra.AsyncMessageBuffer = _Messages  # type: ignore[attr-defined]
