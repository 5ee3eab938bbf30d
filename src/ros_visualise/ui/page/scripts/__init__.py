"""Our title and scripts in viser's page."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from functools import lru_cache
from html import escape
from pathlib import Path

import viser
from websockets.http11 import Response

from ros_visualise.ui.page.worker import Worker

_FOLDER = Path(__file__).parent
_SCRIPTS = ("send.js", "viewer.js", "hold.js", "pick.js", "address.js", "mark.js", "files.js")
"""In the order in which they run, before viser's own."""
_HEAD, _TITLE = b"<head>", b"<title>Viser</title>"


def complete(response: Response, title: str, is_foreign: bool, is_viewer: bool = False) -> Response:
    """Add title and scripts to viser's page; other responses are unchanged.

    Args:
        is_foreign: another web site may have led here: settings in the address are ignored.
        is_viewer: the page is read-only.
    """
    if response.headers.get("Content-Type", "").startswith("text/html"):
        is_packed = response.headers.get("Content-Encoding") == "gzip"
        body = bytes(response.body or b"")
        response.body = _completed(body, is_packed, title, is_foreign, is_viewer)
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))
    return response


def add_channel(
    gui: viser.GuiApi, worker: Worker, name: str, action: Callable[[str, int], object]
) -> None:
    """Have a worker call an action for each text that a script sends by ``rv.send(name, text)``.

    The action is called with the text and the number of the browser.
    """
    element = gui.add_text(name, "", visible=False)

    async def heard(event: viser.GuiEvent[viser.GuiTextHandle]) -> None:
        client = event.client_id
        assert client is not None  # the program sends none
        await worker.listener(None, lambda text: action(text, client))(event)
        element._impl.value = ""  # otherwise viser drops a repeated text

    element.on_update(heard)
    gui.add_html(f'<i hidden data-channel="{name}" data-uuid="{element._impl.uuid}"></i>')


@lru_cache(maxsize=8)
def _completed(
    page: bytes, is_packed: bool, title: str, is_foreign: bool, is_viewer: bool
) -> bytes:
    if is_packed:
        page = gzip.decompress(page)
    if _HEAD not in page or _TITLE not in page:
        raise RuntimeError("unsupported viser: its page has changed")
    texts = [(_FOLDER / name).read_text() for name in _SCRIPTS]
    facts = {"rv.isForeign": is_foreign, "rv.isViewer": is_viewer}
    lines = [f"{name} = true;\n" for name, holds in facts.items() if holds]
    texts[1:1] = lines  # rv is made by the first
    scripts = "".join(f"<script>\n{text}</script>" for text in texts)
    page = page.replace(_HEAD, _HEAD + scripts.encode(), 1)
    page = page.replace(_TITLE, f"<title>{escape(title)}</title>".encode(), 1)
    return gzip.compress(page) if is_packed else page
