"""The gate of the page: it checks all requests before anything is done for them."""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable, MutableMapping
from functools import partial
from typing import Any, NamedTuple

from uvicorn.protocols.utils import ClientDisconnected

from ros_visualise.core import supervision
from ros_visualise.ui.server.access import AccessRules, Fetch
from ros_visualise.ui.server.answers import Answer, Refusal, as_json
from ros_visualise.ui.server.budget import Budget, Client

log = logging.getLogger(__name__)

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]
"""An ASGI application, and what it is called with."""

MOST_REPORTED = 5
"""Maximum number of logged rejections, of requests, and of each browser's messages."""
_METHODS = ("GET", "HEAD")
_LONGEST_PATH = 250  # of a name that file systems take
_MOST_VIEWERS = 150  # connections; a browser has four
_PIECE_BYTES = 64 << 10


class Disconnected(Exception):
    """A browser has left."""


class Visit(NamedTuple):
    """The sender of an allowed request.

    Attributes:
        is_viewer: it may only look.
        is_foreign: another web site may have led here.
        hold: call it with the size of an answer before that is sent; raises Refusal.
    """

    is_viewer: bool
    is_foreign: bool
    hold: Callable[[int], None]


class Gate:
    """An ASGI application that lets allowed requests through to another.

    What comes through has a ``Visit`` in its state, and the token in its ``root_path``.

    Args:
        rules: decides which requests are allowed.
    """

    def __init__(self, app: App, rules: AccessRules) -> None:
        self._app, self._rules = app, rules
        self._budget = Budget()
        self._viewers = 0
        self._reported: set[str] = set()
        allowed = " ".join(["'self'", *sorted(rules.origins)])
        self._headers = encoded(
            {
                "Content-Security-Policy": f"frame-ancestors {allowed}",
                "Cross-Origin-Resource-Policy": "same-origin",
                "Referrer-Policy": "no-referrer",
                "X-Content-Type-Options": "nosniff",
            }
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        give = partial(self._give, send)
        refused = self._refuse(scope)
        if refused is None:
            refused = await self._pass(scope, receive, give)
        if refused is not None:
            await send_answer(scope, give, refused)

    async def _give(self, send: Send, message: MutableMapping[str, Any]) -> None:
        """Send, with headers by which no other site can embed or read this one."""
        if message["type"].endswith((".start", ".accept")):
            message["headers"] = [*message.get("headers", ()), *self._headers]
        await send(message)

    def _refuse(self, scope: Scope) -> Answer | None:
        """The answer to a rejected request; None if it is allowed."""
        path, hosts, origins = _path(scope), _values(scope, b"host"), _values(scope, b"origin")
        if len(hosts) != 1 or len(origins) > 1:
            reason = "a request needs one Host and at most one Origin header"
        else:
            origin = next(iter(origins), None)
            reason = self._rules.refusal(path, hosts[0], origin, _fetch(scope))
        if reason:
            self.report_once(f"page: request rejected: {reason}")
            return _plain(403, f"ros-visualise: {reason}\n")
        if len(self._rules.inside(path)) > _LONGEST_PATH:
            return _plain(414, "no such page\n")
        if scope.get("method", "GET") not in _METHODS:
            return _plain(405, "unsupported method\n")
        return None

    async def _pass(self, scope: Scope, receive: Receive, give: Send) -> Answer | None:
        """Call the application; the answer to what it refuses, or None."""
        is_viewer = self._rules.is_viewer(_path(scope))
        token = self._rules.view_token if is_viewer else self._rules.token
        scope["root_path"] = f"/{token}" if token else ""
        is_foreign = self._rules.is_foreign(_fetch(scope))
        address = (scope["client"] or ("",))[0]
        begun: list[None] = []

        async def note(message: MutableMapping[str, Any]) -> None:
            begun.append(None)
            await give(message)

        try:
            if scope["type"] == "websocket":
                scope["state"]["visit"] = Visit(is_viewer, is_foreign, lambda size: None)
                await self._connect(scope, receive, note, is_viewer)
                return None
            with self._budget.answer(Client(address, is_viewer)) as hold:
                scope["state"]["visit"] = Visit(is_viewer, is_foreign, hold)
                await self._app(scope, receive, note)
        except Refusal as refused:
            return refused.answer
        except ClientDisconnected:
            raise
        except supervision.ERRORS as error:
            supervision.note("the page", error)
            if begun:
                raise
            return as_json({"error": "internal error; see the program's log"}, 500)
        return None

    async def _connect(self, scope: Scope, receive: Receive, give: Send, is_viewer: bool) -> None:
        """Let a WebSocket through; viewers leave room for others."""
        if is_viewer and self._viewers >= _MOST_VIEWERS:
            raise Refusal("busy: too many read-only browsers are connected; try again later", 503)
        self._viewers += is_viewer
        try:
            await self._app(scope, receive, give)
        finally:
            self._viewers -= is_viewer

    def report_once(self, line: str) -> None:
        """Log a warning once, and only a few in all."""
        if line not in self._reported and len(self._reported) < MOST_REPORTED:
            self._reported.add(line)
            log.warning("%s", line)


async def send_answer(scope: Scope, send: Send, answer: Answer) -> None:
    """Send an answer in pieces, each when the browser has accepted the one before."""
    kind = "websocket.http.response" if scope["type"] == "websocket" else "http.response"
    headers = {
        "Connection": "close",
        "Content-Type": answer.type,
        "Content-Length": str(len(answer.body)),
        "Cache-Control": "no-store",
        **answer.headers,
    }
    await send({"type": f"{kind}.start", "status": answer.status, "headers": encoded(headers)})
    body = memoryview(answer.body)
    for start in range(0, max(len(body), 1), _PIECE_BYTES):
        piece, is_more = body[start : start + _PIECE_BYTES], start + _PIECE_BYTES < len(body)
        await send({"type": f"{kind}.body", "body": bytes(piece), "more_body": is_more})


def encoded(headers: MutableMapping[str, str] | dict[str, str]) -> list[tuple[bytes, bytes]]:
    """Headers as ASGI has them."""
    return [(name.lower().encode(), value.encode("latin-1")) for name, value in headers.items()]


def _path(scope: Scope) -> str:
    """The requested path, still encoded."""
    return str(scope["raw_path"].decode("latin-1"))


def _values(scope: Scope, name: bytes) -> list[str]:
    return [value.decode("latin-1") for key, value in scope["headers"] if key == name]


def _fetch(scope: Scope) -> Fetch:
    """A browser's reason for a request; values sent twice are invalid."""
    names = (b"sec-fetch-site", b"sec-fetch-mode", b"sec-fetch-dest")
    return Fetch(*(", ".join(_values(scope, name)) for name in names))


def _plain(status: int, text: str) -> Answer:
    return Answer(text.encode(), "text/plain; charset=utf-8", status)
