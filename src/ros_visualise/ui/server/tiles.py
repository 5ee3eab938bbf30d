"""Tiles of a map from an MBTiles file.

Source: MBTiles specification 1.3 (mapbox/mbtiles-spec): rows of tiles count from the south.
"""

from __future__ import annotations

import re
import sqlite3
import threading
from pathlib import Path

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.ui.server.answers import Answer, Refusal

TILES = "/tiles/"
"""The first part of their paths."""

_ADDRESS = re.compile(r"https?://\S*\{z\}\S*")
_TYPES = {"png": "image/png", "jpg": "image/jpeg", "jpeg": "image/jpeg", "webp": "image/webp"}
_DEEPEST = 30
_PATH = re.compile(r"(\d{1,2})/(\d{1,10})/(\d{1,10})")


class TileFile:
    """An open MBTiles file with pictures.

    Raises:
        OpenError: it is missing, damaged, or holds other tiles.
    """

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise OpenError.missing(path, "give an MBTiles file, or an address with {z}, {x}, {y}")
        self._lock = threading.Lock()
        try:
            self._file = sqlite3.connect(
                f"{path.absolute().as_uri()}?mode=ro", uri=True, check_same_thread=False
            )
            rows = dict(self._file.execute("SELECT name, value FROM metadata"))
            self._file.execute("SELECT tile_data FROM tiles LIMIT 1").fetchone()
        except sqlite3.Error as error:
            raise OpenError(f"{path}: not a readable MBTiles file: {error}") from None
        kind = str(rows.get("format", "png"))
        if kind not in _TYPES:
            raise OpenError(f"{path}: unsupported tile format {kind}; use png, jpg or webp")
        self._type = _TYPES[kind]

    def answer(self, name: str) -> Answer:
        """The tile ``Z/X/Y``, Y from the north; raises Refusal for a missing one."""
        found = _PATH.fullmatch(name)
        z, x, y = map(int, found.groups()) if found else (_DEEPEST + 1, 0, 0)
        if z > _DEEPEST or max(x, y) >= 1 << z:
            raise Refusal("no such tile", 404)
        where = "zoom_level = ? AND tile_column = ? AND tile_row = ?"
        query = f"SELECT tile_data FROM tiles WHERE {where}"
        try:
            with self._lock:
                row = self._file.execute(query, (z, x, (1 << z) - 1 - y)).fetchone()
        except sqlite3.Error as error:
            raise Refusal(f"damaged tiles: {error}", 500) from None
        if row is None or not isinstance(row[0], bytes):
            raise Refusal("no such tile", 404)
        return Answer(row[0], self._type)

    def close(self) -> None:
        """Close it."""
        with self._lock:
            self._file.close()


def open_tiles(text: str) -> tuple[str, TileFile | None]:
    """The template of addresses for what a person gives, and the file, if it is one.

    Args:
        text: address of a server, or path of an MBTiles file; empty: none.

    Raises:
        OpenError: as `TileFile`.
        UsageError: an address without {z}.
    """
    if not text or _ADDRESS.fullmatch(text):
        return text, None
    if "://" in text:
        raise UsageError(f"--tiles {text}: give https://HOST/{{z}}/{{x}}/{{y}}.png")
    return f"{TILES}{{z}}/{{x}}/{{y}}", TileFile(Path(text))
