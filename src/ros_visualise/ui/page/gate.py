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
from ros_visualise.ui.look.answers import HEADER, READ_ONLY, Answer, Question, Refusal, as_json
from ros_visualise.ui.page.budget import Budget
from ros_visualise.ui.page.door import Door, Fetch
from ros_visualise.ui.page.elements import refusal
from ros_visualise.ui.page.inbound import Camera, Update, understand

log = logging.getLogger(__name__)

Receive = Callable[[], Awaitable[str | bytes]]
"""Gives the next message of a connection, or raises where it has ended."""
Answers = Callable[[Question, bool], Awaitable[Answer | None]]
Receiver = Callable[[Question, Receive], Awaitable[None]]
UPLOAD = "upload"
"""What queries of connections hold that are not viser's."""
MOST_SAID = 5
"""At most so many refused requests are logged, and refused messages of each browser."""
_LONGEST_PATH = 250  # of a name that file systems take
_MOST_VIEWERS = 50


class Gate:
    """Checks requests by a door, and messages by the values that the page's elements may have.

    Args:
        door: decides which requests are answered.
        title: of the page.
        answer: gives the answers that are not viser's: called with a question, and whether it comes
            by the read-only address. None: that is viser's to answer.
        receive: takes connections that are not viser's.

    Attributes:
        budget: of the answers that are on their way.
        gui: the elements of the page; None until there are any.
        is_used: whether a server has its connections from here.
        viewers: how many browsers are connected by the read-only address.
    """

    def __init__(
        self, door: Door, title: str, answer: Answers, receive: Receiver | None = None
    ) -> None:
        self.door, self.title, self._answers, self._receive = door, title, answer, receive
        self.budget = Budget()
        self.gui: viser.GuiApi | None = None
        self.is_used = False
        self.viewers = 0
        self._said: set[str] = set()

    def refuse(self, request: Request) -> Answer | None:
        """The answer to a request that may not come in; None if it may."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if len(hosts) != 1 or len(origins) > 1:
            reason = "a request has to name one host, and at most one site that it comes from"
        else:
            origin = next(iter(origins), None)
            reason = self.door.refusal(request.path, hosts[0], origin, fetch_of(request))
        if reason:
            self.say_once(f"the page refused a request: {reason}")
            return _plain(HTTPStatus.FORBIDDEN, f"ros-visualise: {reason}\n")
        if len(self.door.inside(request.path).partition("?")[0]) > _LONGEST_PATH:
            return _plain(HTTPStatus.REQUEST_URI_TOO_LONG, "no such page\n")
        return None

    def refuse_connection(self, query: str, is_viewer: bool) -> Answer | None:
        """The answer to a connection that may not come in; None if it may."""
        try:
            if UPLOAD in Question(query) and is_viewer:
                raise Refusal(READ_ONLY, 403)
            if is_viewer and self.viewers >= _MOST_VIEWERS:
                raise Refusal(f"busy: {self.viewers} browsers are connected; try again later", 503)
        except Refusal as refused:
            return refused.answer
        return None

    def refuse_message(self, data: str | bytes, is_viewer: bool) -> str | None:
        """Why a message is dropped, or empty to drop it silently; None if it is allowed."""
        message = understand(data)
        if message is None:
            return ""
        if is_viewer and not isinstance(message, Camera):
            self.say_once(f"the page: a viewer tried to change something: {READ_ONLY}")
            return ""
        if not isinstance(message, Update):
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
        """Set the element in browsers back to its value, after one of them tried another."""
        if not isinstance(element, viser.GuiButtonHandle | viser.GuiButtonGroupHandle):
            assert self.gui is not None
            message = GuiUpdateMessage(uuid, {"value": element.value})
            self.gui._websock_interface.queue_message(message)

    async def answer(self, query: str, headers: Any, is_viewer: bool) -> Answer | None:
        """The answer to an allowed request; None where it is viser's to answer."""
        try:
            question = Question(query)
            if "ask" in question and headers.get_all(HEADER) != ["1"]:
                raise Refusal("only pages of this server may ask", 403)
            return await self._answers(question, is_viewer)
        except Refusal as refused:
            return refused.answer
        except supervision.ERRORS as error:
            supervision.note("the page", error)
            return as_json({"error": "this failed; the program's log says where"}, 500)

    async def takes(self, query: str, receive: Receive) -> bool:
        """Whether a connection was ours and not viser's."""
        question = Question(query)
        if self._receive is None or UPLOAD not in question:
            return False
        await self._receive(question, receive)
        return True

    def say_once(self, line: str) -> None:
        """Log a warning, once, and not too many of them."""
        if line not in self._said and len(self._said) < MOST_SAID:
            self._said.add(line)
            log.warning("%s", line)


def fetch_of(request: Request) -> Fetch:
    """What a browser says of why it asks; what it says twice is neither."""
    names = ("Sec-Fetch-Site", "Sec-Fetch-Mode", "Sec-Fetch-Dest")
    return Fetch(*(", ".join(request.headers.get_all(name)) for name in names))


def _plain(status: HTTPStatus, text: str) -> Answer:
    return Answer(text.encode(), "text/plain; charset=utf-8", status.value)
