"""Tiles of a map from a file."""

import sqlite3

import pytest

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.ui.server.answers import Refusal
from ros_visualise.ui.server.tiles import TileFile, open_tiles


def make(path, kind="png"):
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE metadata (name TEXT, value TEXT)")
        file.execute("INSERT INTO metadata VALUES ('format', ?)", (kind,))
        file.execute("CREATE TABLE tiles (zoom_level, tile_column, tile_row, tile_data BLOB)")
        file.execute("INSERT INTO tiles VALUES (2, 1, 0, ?)", (b"southernmost",))
    file.close()
    return path


def test_rows_count_from_the_north(tmp_path):
    template, tiles = open_tiles(str(make(tmp_path / "a b#.mbtiles", "jpg")))
    assert template == "/tiles/{z}/{x}/{y}"
    answer = tiles.answer("2/1/3")
    assert (bytes(answer.body), answer.type) == (b"southernmost", "image/jpeg")
    for name in ("2/1/0", "2/4/0", "99/0/0", "2/1/3/4", "../x", "2/-1/3", "2/1/3'"):
        with pytest.raises(Refusal):
            tiles.answer(name)
    tiles.close()


def test_what_is_no_file_of_pictures(tmp_path):
    (tmp_path / "text.mbtiles").write_text("no database")
    for path, expected in (
        (tmp_path / "text.mbtiles", "not a readable MBTiles file"),
        (make(tmp_path / "v.mbtiles", "pbf"), "unsupported tile format pbf; use png"),
        (tmp_path / "none.mbtiles", "no such file"),
    ):
        with pytest.raises(OpenError, match=expected):
            TileFile(path)
    with pytest.raises(UsageError, match="give https"):
        open_tiles("https://tile.example.org/0/0/0.png")
    assert open_tiles("https://tile.example.org/{z}/{x}/{y}.png")[1] is None
    assert open_tiles("") == ("", None)
