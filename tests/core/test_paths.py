"""Names of files that a page or a parameter gives: plain ones, in one folder."""

from pathlib import Path

import pytest

from ros_visualise.core.errors import UsageError
from ros_visualise.core.paths import inside

ELSEWHERE = [
    "",
    ".",
    "..",
    ".bashrc",
    "../r.mcap",
    "/tmp/r.mcap",
    "sub/r.mcap",
    "sub\\r.mcap",
    "./r.mcap",
    "r/",
    "~/r.mcap",
    "r.mcap@/edges",
    "../r.mcap@/edges",
    "@/../r.mcap",
    "a@/../../x.bag",
    "r\0.mcap",
    "r\n.mcap",
    "r\x1b]0;.mcap",
    "r\x7f",
    "\ud800.mcap",
    "x" * 201,
    "ü" * 100 + "x",
    "/\0" * 100_000,
]


@pytest.mark.parametrize("name", ELSEWHERE, ids=lambda name: repr(name[:20]))
def test_names_that_are_none(tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError) as error:
        inside(tmp_path, name)
    assert str(error.value).isprintable()
    assert len(str(error.value)) < 300


@pytest.mark.parametrize(
    "name", ["r.mcap", "folder", "a b.bag", "a@", "me@home.mp4", "x" * 195 + ".mcap", "ü-☃.mcap"]
)
def test_names_in_the_folder(tmp_path: Path, name: str) -> None:
    assert inside(tmp_path, name) == tmp_path / name
    assert inside(Path(), name) == Path(name)


def test_links_stay_in_the_folder(tmp_path: Path) -> None:
    (folder := tmp_path / "folder").mkdir()
    (tmp_path / "other").symlink_to(folder)
    (folder / "out").symlink_to(tmp_path / "x.bag")
    (folder / "up").symlink_to(tmp_path)
    (folder / "beside").symlink_to("x.bag")
    (folder / "round").symlink_to("round")
    for name in ("out", "up"):
        with pytest.raises(UsageError, match="outside the folder"):
            inside(folder, name)
    assert inside(folder, "beside") == folder / "beside"
    assert inside(folder, "round") == folder / "round"
    assert inside(tmp_path / "other", "x.bag") == tmp_path / "other" / "x.bag"
