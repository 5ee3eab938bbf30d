"""A ROS master some of whose answers are cut off."""

from __future__ import annotations

import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.request import urlopen


class CuttingMaster(ThreadingHTTPServer):
    """Passes on what a real master answers; of the answers to some methods only the first half.

    Attributes:
        methods: whose answers are cut; may be changed.
        cut: how many were.
    """

    daemon_threads = True

    def __init__(self, uri: str, methods: Collection[str]) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.real_uri, self.methods, self.cut = uri, methods, 0

    @property
    def uri(self) -> str:
        return f"http://127.0.0.1:{self.server_port}"


class _Handler(BaseHTTPRequestHandler):
    server: CuttingMaster

    def do_POST(self) -> None:
        request = self.rfile.read(int(self.headers["Content-Length"]))
        with urlopen(self.server.real_uri, request) as answered:
            answer = answered.read()
        is_cut = any(f"<methodName>{one}<".encode() in request for one in self.server.methods)
        self.send_response(200)
        self.send_header("Content-Type", "text/xml")
        self.send_header("Content-Length", str(len(answer)))
        self.end_headers()
        self.wfile.write(answer[: len(answer) // 2] if is_cut else answer)
        self.server.cut += is_cut
        self.close_connection = True

    def log_message(self, *_: object) -> None:
        pass


@contextmanager
def cutting(uri: str, *methods: str) -> Iterator[CuttingMaster]:
    """Within this, such a master before the real one of that address."""
    with CuttingMaster(uri, methods) as master:
        threading.Thread(target=master.serve_forever, daemon=True).start()
        yield master
        master.shutdown()
