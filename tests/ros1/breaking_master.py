"""What stands before a master, and can answer in its place as nobody should."""

from __future__ import annotations

import threading
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from xmlrpc.client import dumps

WORDS = {
    "cut": lambda reply: reply[: len(reply) // 2],
    "empty": lambda reply: b"",
    "no XML": lambda reply: b"\x00\xff it works",
    "another's": lambda reply: b"<html><body>proxy</body></html>",
    "no list": lambda reply: dumps((5,), methodresponse=True).encode(),
    "of no lists": lambda reply: dumps(([1, "", 7],), methodresponse=True).encode(),
    "of no numbers": lambda reply: reply.replace(b"<int>1</int>", b"<int>one</int>"),
}
"""How a reply is broken."""


class BreakingMaster:
    """Passes on what a master is asked; while `broken`, breaks what it replies.

    Args:
        master_uri: of the real one.
    """

    def __init__(self, master_uri: str) -> None:
        self._break: Any = None
        passer = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                request = urllib.request.Request(
                    master_uri, body, {"Content-Type": self.headers["Content-Type"]}
                )
                with urllib.request.urlopen(request) as answer:
                    reply = answer.read()
                reply = passer._break(reply) if passer._break else reply
                self.send_response(200)
                self.send_header("Content-Type", "text/xml")
                self.send_header("Content-Length", str(len(reply)))
                self.end_headers()
                self.wfile.write(reply)

            def log_message(self, *_: object) -> None:
                """Print nothing."""

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.uri = f"http://127.0.0.1:{self._server.server_port}"
        self._thread = threading.Thread(target=self._server.serve_forever)
        self._thread.start()

    @contextmanager
    def broken(self, how: str) -> Iterator[None]:
        """Within this, every reply is broken."""
        self._break = WORDS[how]
        yield
        self._break = None

    def close(self) -> None:
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()
