"""One kind of live data of the page, such as its images or its clock."""

from __future__ import annotations

from typing import Protocol

from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.server.gate import Receive, Scope, Send


class Hub(Protocol):
    """Serves browsers over WebSockets of one path.

    Attributes:
        path: of the WebSockets, below the token.
    """

    path: str

    def show(self, runtime: Runtime | None) -> None:
        """Serve this graph from now on, or none; from any thread."""

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves; ``scope["state"]["visit"]`` says what it may do."""

    def close(self) -> None:
        """End all threads."""
