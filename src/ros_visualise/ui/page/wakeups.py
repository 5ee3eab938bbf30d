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
    """Let any thread change pages that are opened from now on.

    Whenever a thread changes a page, viser 1.1 sets an `asyncio.Event` there and then, and once
    more from its loop. Events are not made for the first: now and then it raises a RuntimeError,
    as the loop changes the list of who waits meanwhile. The second alone does as well.
    """
    _infra.AsyncMessageBuffer = _Messages  # type: ignore[attr-defined]
