"""Our scripts in viser's page."""

from __future__ import annotations

import gzip
from functools import lru_cache
from pathlib import Path

import viser

from ros_visualise.core.regular_files import read_file

_FOLDER = Path(__file__).parent
_SCRIPTS = ("send.js", "viewer.js", "keys.js")
"""In the order in which they run, before viser's own."""
_HEAD = b"<head>"
_VISER = Path(viser.__file__).parent / "client" / "build" / "index.html"


@lru_cache(maxsize=4)
def client_page(is_foreign: bool, is_viewer: bool) -> bytes:
    """viser's page with our scripts, packed by gzip.

    Args:
        is_foreign: another web site may have led here: settings in the address are ignored.
        is_viewer: the page is read-only.
    """
    page = read_file(_VISER)
    if _HEAD not in page:
        raise RuntimeError("unsupported viser: its page has changed")
    texts = [(_FOLDER / name).read_text() for name in _SCRIPTS]
    facts = {"rv.isForeign": is_foreign, "rv.isViewer": is_viewer}
    lines = [f"{name} = true;\n" for name, holds in facts.items() if holds]
    texts[1:1] = lines  # rv is made by the first
    scripts = "".join(f"<script>\n{text}</script>" for text in texts)
    page = page.replace(_HEAD, _HEAD + scripts.encode(), 1)
    return gzip.compress(page)
