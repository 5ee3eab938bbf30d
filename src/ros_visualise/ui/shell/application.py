"""NiceGUI, made once for all pages of a process."""

from __future__ import annotations

import asyncio
import logging
from contextlib import AbstractAsyncContextManager
from functools import cache
from typing import Any

import nicegui
from fastapi import FastAPI, Request
from nicegui import ui

from ros_visualise.core import supervision
from ros_visualise.ui.server.gate import App
from ros_visualise.ui.server.host import page_loop

NICEGUI = "/_nicegui"
"""The first part of the paths of its files and its WebSockets."""
_RECONNECT_S = 60.0  # browsers that come back later load the page again


@cache
def application() -> App:
    """NiceGUI's application: a request builds the page by ``shell`` in its state."""
    logging.getLogger("nicegui").setLevel(logging.CRITICAL + 1)  # it logs addresses, with tokens
    nicegui.app.on_exception(lambda error: supervision.note("the page", error))
    nicegui.app.config.socket_io_js_transports = ["websocket"]
    site = FastAPI(openapi_url=None, docs_url=None, redoc_url=None)
    ui.page("/")(_build)
    ui.run_with(
        site,
        dark=None,
        language="en-US",
        reconnect_timeout=_RECONNECT_S,
        binding_refresh_interval=None,
        show_welcome_message=False,
        tailwind=False,
    )
    running: AbstractAsyncContextManager[Any] = site.router.lifespan_context(site)
    asyncio.run_coroutine_threadsafe(running.__aenter__(), page_loop()).result()
    return site


def _build(request: Request) -> None:
    """Build the page for one browser."""
    request.scope["state"]["shell"](request.scope)
