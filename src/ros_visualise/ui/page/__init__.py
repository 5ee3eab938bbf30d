"""The page: a running graph in the browser, with a window for each node."""

from __future__ import annotations

import logging
import socket
import threading
from collections.abc import Collection
from functools import partial
from pathlib import Path
from types import MappingProxyType

from ros_visualise.core.printing import print_status
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.arrangements import Arrangement
from ros_visualise.ui.look import Answer, Looker
from ros_visualise.ui.look.answers import Question, Refusal
from ros_visualise.ui.page.browser import Browser
from ros_visualise.ui.page.desk import Desk
from ros_visualise.ui.page.door import Door, open_door
from ros_visualise.ui.page.files import Files
from ros_visualise.ui.page.kept import Memory
from ros_visualise.ui.page.pool import Pool
from ros_visualise.ui.page.server import close_server, empty_server, open_server, url
from ros_visualise.ui.shelf import Shelf

log = logging.getLogger(__name__)

_TITLE = "ros_visualise"
_CLOSE_S, _LEAVE_S = 0.3, 5.0
_ANSWERING = 8  # threads: some wait a second for an image


class Page:
    """Serves the page, from the start.

    Args:
        host, port: where it listens.
        title: of the page.
        origins: other web sites that may use the page, as ``https://robot.example.org``.
        record_dir: the only folder in which it records, and to which it uploads.
        browser: whether to open one on this machine.
        arrangement: how it is arranged at first.
        shelf: the files that can be opened from it; None: none.
        token: whether it opens by addresses with a token alone.
        urdf: the robot to draw; empty: as topics describe it.

    Attributes:
        url: its address for a browser on this machine.
        view_url: the address by which it is read-only; empty without tokens.

    Raises:
        OpenError: the port is in use, or the address is not one of this machine.
        UsageError: as `ros_visualise.ui.page.door.open_door`.
    """

    stays = True

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 8080,
        title: str = _TITLE,
        origins: Collection[str] = (),
        record_dir: Path = Path(),
        flag: str = "--{} {}",
        browser: bool = False,
        arrangement: Arrangement = MappingProxyType({}),
        shelf: Shelf | None = None,
        token: bool = True,
        urdf: str = "",
    ) -> None:
        door = open_door(host, origins, token)
        if door.addresses and not token:
            log.warning("no token: whoever reaches %s can use the page", host)
        self._urdf = urdf
        self._files, self._memory = Files(record_dir, shelf), Memory(arrangement)
        self._questions = Pool("page answers", _ANSWERING)
        self.url = url(host, port, door.token)
        self.view_url = url(host, port, door.view_token) if token else ""
        self._addresses = _lines(host, port, door)
        self._looker: Looker | None = None  # somebody may ask as soon as there is a server
        self._server = open_server(host, port, title, door, flag, self._answer, self._files.receive)
        self._browser = Browser(self.url, lambda: not self.awaited) if browser else None
        self._desk: Desk | None = None
        self._ended = threading.Event()

    @property
    def closed(self) -> bool:
        """Never: whoever closes the browser may open it again."""
        return False

    @property
    def awaited(self) -> bool:
        """Whether no browser shows it."""
        return not self._server.get_clients()

    def open(self, runtime: Runtime) -> None:
        """Show this graph from now on, in place of the one before."""
        if self._desk is not None:
            self._leave()
            self._show(runtime)
            self._server.gui.set_panel_label(self._files.title)
            return
        self._show(runtime)
        for line in self._addresses:
            print_status(line)
        if self._browser is not None:
            self._browser.open()

    def _show(self, runtime: Runtime) -> None:
        self._looker = Looker(runtime)
        self._desk = Desk(
            self._server, runtime, self._files, self._looker, self._memory, self._urdf
        )

    def _leave(self) -> None:
        """Take the present graph from the page; how it is arranged is remembered."""
        assert self._desk is not None
        assert self._looker is not None
        self._desk.close(_LEAVE_S)
        self._looker.close()
        empty_server(self._server)

    async def _answer(self, question: Question, is_viewer: bool) -> Answer | None:
        if question.text("ask") == "recorded":
            return await self._files.answer(question)
        if self._looker is not None:
            return await self._questions.do(partial(self._looker.answer, question, is_viewer))
        if "ask" in question or "look" in question:
            raise Refusal("nothing is shown yet; try again in a moment", 503)
        return None

    def spin(self, timeout_s: float) -> None:
        """Wait: nothing has to be done on the main thread."""
        self._ended.wait(timeout_s)

    def close(self) -> None:
        """Close it; it may be called more than once."""
        if self._ended.is_set():
            return
        self._ended.set()
        if self._desk is not None:
            self._desk.close(_CLOSE_S)
        if self._looker is not None:
            self._looker.close()
        close_server(self._server)
        self._questions.close()
        self._files.close()
        if self._browser is not None:
            self._browser.close()


def _lines(host: str, port: int, door: Door) -> list[str]:
    """What a person reads of where the page is. Logs have none of it: it holds tokens."""
    names = [host] if not door.addresses else [host, socket.gethostname()]
    addresses = " or from elsewhere at ".join(url(name, port, door.token) for name in names)
    lines = [f"look at {addresses} (Ctrl-C ends it)"]
    if door.view_token:
        addresses = " or from elsewhere at ".join(
            url(name, port, door.view_token) for name in names
        )
        lines.append(f"read-only: {addresses}")
    return lines
