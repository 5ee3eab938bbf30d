"""A WebSocket of the page: what is sent to one browser, and what it sends."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any

from uvicorn.protocols.utils import ClientDisconnected

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
    tasks = [asyncio.ensure_future(one) for one in (sending, _hear_all(receive, hear))]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            with suppress(ClientDisconnected):
                task.result()  # a bug ends the connection, and is reported
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _hear_all(receive: Receive, hear: Callable[[str], object]) -> None:
    while (message := await receive())["type"] != "websocket.disconnect":
        hear(message.get("text") or "")


def read_object(text: str) -> dict[str, Any] | None:
    """The JSON object in a text from a browser; None for anything else."""
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return message if isinstance(message, dict) else None


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
