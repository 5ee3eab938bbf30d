"""A WebSocket of the page: what is sent to one browser, and what it sends."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine

from ros_visualise.ui.server.gate import Receive, Send


async def exchange(
    receive: Receive,
    send: Send,
    sending: Coroutine[None, None, None],
    hear: Callable[[str], object],
) -> None:
    """Accept a browser, and serve it until it leaves.

    Args:
        sending: sends it messages; cancelled when it has left.
        hear: called with each text from it.
    """
    await receive()  # the request to connect
    await send({"type": "websocket.accept"})
    task = asyncio.ensure_future(sending)
    try:
        while (message := await receive())["type"] != "websocket.disconnect":
            hear(message.get("text") or "")
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def ignore(text: str) -> None:
    """Do nothing with a text from a browser that may not ask."""


async def wait(event: asyncio.Event, timeout_s: float) -> None:
    """Wait for an event, or until the time is over; it is cleared then."""
    timer = asyncio.get_running_loop().call_later(timeout_s, event.set)
    try:
        await event.wait()
    finally:
        timer.cancel()
        event.clear()
