"""Opens the page in a browser of this machine."""

from __future__ import annotations

import threading
import webbrowser
from collections.abc import Callable
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory

from ros_visualise.core import supervision
from ros_visualise.core.printing import print_status

_FORWARD = """<!doctype html><meta charset="utf-8"><meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0;url={0}"><a href="{0}">ros_visualise</a>
"""
_PATIENCE_S, _LOOK_S, _CLOSE_S = 30.0, 0.2, 0.5


class Browser:
    """Opens a secret address.

    Every account can read the command lines of programs. So the browser is given a file that
    forwards it to the address, and that only its owner may read.
    """

    def __init__(self, url: str, has_come: Callable[[], bool]) -> None:
        self._url, self._has_come = url, has_come
        self._ended = threading.Event()
        self._opening: threading.Thread | None = None

    def open(self) -> None:
        """Open it, on a thread of its own: that may take long."""
        self._opening = supervision.start("browser", self._open)

    def close(self) -> None:
        self._ended.set()
        if self._opening is not None:
            self._opening.join(_CLOSE_S)

    def _open(self) -> None:
        with TemporaryDirectory(prefix="ros-visualise-") as folder:  # its owner's alone
            path = Path(folder, "page.html")
            path.write_text(_FORWARD.format(escape(self._url)))
            if not (webbrowser.open(path.as_uri()) and self._wait()):
                print_status("no browser opened; open the address above")

    def _wait(self) -> bool:
        """True if a browser came, or the program ends."""
        for _ in range(int(_PATIENCE_S / _LOOK_S)):
            if self._has_come() or self._ended.wait(_LOOK_S):
                return True
        return False
