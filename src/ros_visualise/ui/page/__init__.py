"""The page: a running graph in the browser, with a window for each node."""

from __future__ import annotations

import logging
import socket
import threading
import webbrowser
from collections.abc import Collection, Mapping
from pathlib import Path
from types import MappingProxyType

from ros_visualise import supervision
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.arrangements import Arrangement
from ros_visualise.ui.look import Answer, Looker
from ros_visualise.ui.look.answers import Question, Refusal, as_json
from ros_visualise.ui.page.desk import Desk
from ros_visualise.ui.page.door import open_door
from ros_visualise.ui.page.files import Files
from ros_visualise.ui.page.kept import Memory
from ros_visualise.ui.page.server import close_server, empty_server, open_server, url
from ros_visualise.ui.shelf import Shelf

log = logging.getLogger(__name__)

_TITLE = "ros_visualise"
_CLOSE_S, _LEAVE_S = 0.3, 5.0


class Page:
    """Serves the page, from the start.

    Args:
        host, port: where it listens; an address that other machines can reach needs a token.
        title: of the page.
        origins: other web sites that may use the page, as ``https://robot.example.org``.
        record_dir: the only folder in which it records, and to which it uploads.
        browser: whether to open one on this machine.
        arrangement: how it is arranged at first.
        shelf: the files that can be opened from it; None: none.

    Attributes:
        url: its address for a browser on this machine.

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
    ) -> None:
        self._files, self._memory = Files(record_dir, shelf), Memory(arrangement)
        door = open_door(host, origins)
        self.url = url(host, port, door.token)
        self._elsewhere = url(socket.gethostname(), port, door.token) if door.token else ""
        self._looker: Looker | None = None  # somebody may ask as soon as there is a server
        self._server = open_server(host, port, title, door, flag, self._answer, self._files.receive)
        self._opens = browser
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
        elsewhere = f", from elsewhere at {self._elsewhere}" if self._elsewhere else ""
        log.info("look at %s%s; Ctrl-C ends it", self.url, elsewhere)
        if self._opens:
            supervision.start("browser", self._open_browser)

    def _show(self, runtime: Runtime) -> None:
        self._looker = Looker(runtime)
        self._desk = Desk(self._server, runtime, self._files, self._looker, self._memory)

    def _leave(self) -> None:
        """Take the present graph from the page; how it is arranged is remembered."""
        assert self._desk is not None
        assert self._looker is not None
        self._desk.close(_LEAVE_S)
        self._looker.close()
        empty_server(self._server)

    def _open_browser(self) -> None:
        if not webbrowser.open(self.url):
            log.warning("no browser could be opened: open %s in one", self.url)

    def _answer(self, query: str, headers: Mapping[str, str]) -> Answer | None:
        try:
            question = Question(query)
            found = self._files.answer(question, headers)
            if found is None and self._looker is None and ("ask" in question or "look" in question):
                raise Refusal("nothing is shown yet; try again in a moment", 503)
        except Refusal as refusal:
            return as_json({"error": str(refusal)}, refusal.status)
        if found is not None or self._looker is None:
            return found
        return self._looker.answer(query, headers)

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
