"""The gate of the page: it checks all requests and messages before anything is done for them."""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from typing import Any

import viser
from viser._messages import GuiUpdateMessage
from websockets.http11 import Request

from ros_visualise.core import supervision
from ros_visualise.ui.look.answers import HEADER, READ_ONLY, Answer, BrowserQuery, Refusal, as_json
from ros_visualise.ui.page.access import AccessRules, Fetch
from ros_visualise.ui.page.budget import Budget
from ros_visualise.ui.page.inbound import CameraMessage, UpdateMessage, refusal, understand

log = logging.getLogger(__name__)

Receive = Callable[[], Awaitable[str | bytes]]
"""Gives the next message of a connection, or raises where it has ended."""
Answers = Callable[[BrowserQuery, bool], Awaitable[Answer | None]]
Receiver = Callable[[BrowserQuery, Receive], Awaitable[None]]
UPLOAD = "upload"
"""The parameter of queries whose connections are not viser's."""
MOST_REPORTED = 5
"""Maximum number of logged rejections, of requests, and of each browser's messages."""
_LONGEST_PATH = 250  # of a name that file systems take
_MOST_VIEWERS = 50


class Gate:
    """Checks requests by the access rules, and messages by the values that elements may have.

    Args:
        rules: decides which requests are answered.
        title: of the page.
        answer: answers a query, given whether it is read-only; None leaves it to viser.
        receive: takes connections that are not viser's.

    Attributes:
        gui: the elements of the page; None until there are any.
        is_used: True once a server has its connections from here.
        viewers: number of read-only browsers.
    """

    def __init__(
        self, rules: AccessRules, title: str, answer: Answers, receive: Receiver | None = None
    ) -> None:
        self.rules, self.title, self._answers, self._receive = rules, title, answer, receive
        self.budget = Budget()
        self.gui: viser.GuiApi | None = None
        self.is_used = False
        self.viewers = 0
        self._reported: set[str] = set()

    def refuse(self, request: Request) -> Answer | None:
        """The answer to a rejected request; None if it is allowed."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if len(hosts) != 1 or len(origins) > 1:
            reason = "a request needs one Host and at most one Origin header"
        else:
            origin = next(iter(origins), None)
            reason = self.rules.refusal(request.path, hosts[0], origin, fetch_of(request))
        if reason:
            self.report_once(f"page: request rejected: {reason}")
            return _plain(HTTPStatus.FORBIDDEN, f"ros-visualise: {reason}\n")
        if len(self.rules.inside(request.path).partition("?")[0]) > _LONGEST_PATH:
            return _plain(HTTPStatus.REQUEST_URI_TOO_LONG, "no such page\n")
        return None

    def refuse_connection(self, query: str, is_viewer: bool) -> Answer | None:
        """The answer to a rejected connection; None if it is allowed."""
        try:
            if UPLOAD in BrowserQuery(query) and is_viewer:
                raise Refusal(READ_ONLY, 403)
            if is_viewer and self.viewers >= _MOST_VIEWERS:
                raise Refusal(f"busy: {self.viewers} browsers are connected; try again later", 503)
        except Refusal as refused:
            return refused.answer
        return None

    def refuse_message(self, data: str | bytes, is_viewer: bool) -> str | None:
        """The reason to drop a message, or empty to drop it silently; None if it is allowed."""
        message = understand(data)
        if message is None:
            return ""
        if is_viewer and not isinstance(message, CameraMessage):
            self.report_once(f"page: change by a viewer rejected: {READ_ONLY}")
            return ""
        if not isinstance(message, UpdateMessage):
            return None
        there = {} if self.gui is None else self.gui._gui_input_handle_from_uuid
        element = there.get(message.uuid)
        if element is None:  # it was taken away meanwhile
            return ""
        reason = refusal(element, message.updates.value)
        if not reason:
            return None
        self._show_again(message.uuid, element)
        return f"{getattr(element, 'label', '')}: {reason}"

    def _show_again(self, uuid: str, element: Any) -> None:
        """Restore an element in browsers, after one of them tried another value."""
        if not isinstance(element, viser.GuiButtonHandle | viser.GuiButtonGroupHandle):
            assert self.gui is not None
            message = GuiUpdateMessage(uuid, {"value": element.value})
            self.gui._websock_interface.queue_message(message)

    async def answer(self, query: str, headers: Any, is_viewer: bool) -> Answer | None:
        """The answer to an allowed request; None leaves it to viser."""
        try:
            asked = BrowserQuery(query)
            if "ask" in asked and headers.get_all(HEADER) != ["1"]:
                raise Refusal("only pages of this server may send queries", 403)
            return await self._answers(asked, is_viewer)
        except Refusal as refused:
            return refused.answer
        except supervision.ERRORS as error:
            supervision.note("the page", error)
            return as_json({"error": "internal error; see the program's log"}, 500)

    async def takes(self, query: str, receive: Receive) -> bool:
        """Take a connection that is not viser's; True if it was one."""
        asked = BrowserQuery(query)
        if self._receive is None or UPLOAD not in asked:
            return False
        await self._receive(asked, receive)
        return True

    def report_once(self, line: str) -> None:
        """Log a warning once, and only a few in all."""
        if line not in self._reported and len(self._reported) < MOST_REPORTED:
            self._reported.add(line)
            log.warning("%s", line)


def fetch_of(request: Request) -> Fetch:
    """A browser's reason for a request; values sent twice are invalid."""
    names = ("Sec-Fetch-Site", "Sec-Fetch-Mode", "Sec-Fetch-Dest")
    return Fetch(*(", ".join(request.headers.get_all(name)) for name in names))


def _plain(status: HTTPStatus, text: str) -> Answer:
    return Answer(text.encode(), "text/plain; charset=utf-8", status.value)
