"""JavaScript of the page; each file is served by its name."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from ros_visualise.core.regular_files import read_file
from ros_visualise.ui.server.answers import Answer, Refusal

PARTS = "/parts/"
"""The first part of their paths."""
_FOLDER = Path(__file__).parent


@cache
def _files() -> dict[str, bytes]:
    return {path.name: read_file(path) for path in _FOLDER.glob("*.js")}


def part(name: str) -> Answer:
    """A file; raises Refusal for an unknown name."""
    if name not in _files():
        raise Refusal("no such file", 404)
    return Answer(_files()[name], "text/javascript; charset=utf-8")
