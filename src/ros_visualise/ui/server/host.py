"""Runs ASGI applications: all of a process on one thread with one event loop."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Sequence
from concurrent.futures import TimeoutError as NotYet
from contextlib import suppress
from functools import cache, partial
from typing import Any

import uvicorn

from ros_visualise.core import supervision
from ros_visualise.ui.server.door import Door
from ros_visualise.ui.server.gate import Gate

MAX_BYTES = 64 * 1024
"""Maximum size of one message on a WebSocket; typed text and pieces of files are the largest."""
_CLOSE_S = 0.8
_GOODBYE_S = 0.1


@cache
def page_loop() -> asyncio.AbstractEventLoop:
    """The event loop of all pages of this process; NiceGUI works on no more than one."""
    loop = asyncio.new_event_loop()
    supervision.start("page server", loop.run_forever)
    return loop


class PageHost:
    """Serves what is behind a gate from the start, until it is closed; ``serving`` ends then."""

    def __init__(self, gate: Gate, listening: Sequence[socket.socket]) -> None:
        for name in ("uvicorn.error", "uvicorn.access"):  # lost connections are normal
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        self._server = _Uvicorn(
            uvicorn.Config(
                gate,
                http=partial(Door, silent={}, report=gate.report_once),  # type: ignore[arg-type]
                ws="websockets-sansio",
                ws_max_size=MAX_BYTES,
                ws_per_message_deflate=False,
                log_config=None,
                server_header=False,
                date_header=False,
                proxy_headers=False,
                lifespan="off",
            )
        )
        serve = self._server.serve(list(listening))
        self.serving = asyncio.run_coroutine_threadsafe(serve, page_loop())

    def close(self) -> None:
        """Stop, without waiting for browsers."""
        self._server.should_exit = True
        with suppress(NotYet):
            self.serving.result(_CLOSE_S)


class _Uvicorn(uvicorn.Server):
    """A server that closes all connections as it ends."""

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        for server in self.servers:
            server.close()
        for connection in list(self.server_state.connections):
            connection.shutdown()
        await asyncio.sleep(_GOODBYE_S)  # those accepted just now are known after it
        for connection in list(self.server_state.connections):
            connection.transport.abort()
        tasks: set[asyncio.Task[Any]] = set(self.server_state.tasks)
        for task in tasks:
            task.cancel()
        if tasks:
            await asyncio.wait(tasks, timeout=_GOODBYE_S)
