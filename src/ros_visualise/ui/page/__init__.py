"""The page: a running graph in the browser, with a window for each node."""

from __future__ import annotations

import logging
import threading

from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.page.desk import Desk
from ros_visualise.ui.page.server import close_server, open_server, url

log = logging.getLogger(__name__)

_TITLE = "ros_visualise"


class Page:
    """Serves the page; the address is bound at once.

    Raises:
        OpenError: the port is in use, or the address is not one of this machine.
    """

    stays = True

    def __init__(self, host: str = "127.0.0.1", port: int = 8080, title: str = _TITLE) -> None:
        self.url = url(host, port)
        self._server = open_server(host, port, title)
        self._desk: Desk | None = None
        self._ended = threading.Event()

    @property
    def closed(self) -> bool:
        """Never: whoever closes the browser may open it again."""
        return False

    def open(self, runtime: Runtime) -> None:
        """Show this graph from now on."""
        self._desk = Desk(self._server, runtime)
        log.info("look at %s; Ctrl-C ends it", self.url)

    def spin(self, timeout_s: float) -> None:
        """Nothing has to be done on the main thread: wait."""
        self._ended.wait(timeout_s)

    def close(self) -> None:
        """Take it away; more than once does no harm."""
        if self._ended.is_set():
            return
        self._ended.set()
        if self._desk is not None:
            self._desk.close()
        close_server(self._server)
