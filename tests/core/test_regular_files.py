"""Files are opened in one place, which waits for nobody."""

from __future__ import annotations

import ast
import os
import re
from pathlib import Path

import pytest

import ros_visualise
from ros_visualise.core.regular_files import open_file, read_file, read_text

ROOT = Path(ros_visualise.__file__).parent
OWN = {
    "core/regular_files.py",  # the place itself
    "runtime/ros2/types.py",  # definitions of ROS 2
    "simulation/model.py",  # and what is in this package
    "ui/page/scripts/__init__.py",
    "ui/parts/__init__.py",
}
"""Files that open nothing but what is installed."""
_CALLS = re.compile(r"\b(open|read_bytes|read_text)\(")
"""In the text of each file that calls one of these."""


@pytest.fixture
def pipe(tmp_path: Path) -> Path:
    """A pipe with the name of a file, to which nobody writes."""
    os.mkfifo(tmp_path / "x.bag")
    return tmp_path / "x.bag"


def test_a_file_is_read(tmp_path: Path):
    (path := tmp_path / "x").write_bytes(b"\xff1\n")
    (tmp_path / "link").symlink_to(path)
    with open_file(path) as file:
        assert (file.read(), file.name) == (b"\xff1\n", str(path))
    assert read_file(str(tmp_path / "link")) == b"\xff1\n"
    assert read_text(path) == "\ufffd1\n"


def test_pipes_and_devices_are_refused(pipe: Path):
    (link := pipe.with_name("link")).symlink_to(pipe)
    for path in (pipe, link, Path("/dev/zero"), Path("/dev/null")):
        with pytest.raises(OSError, match="not a regular file"):
            open_file(path)
    with pytest.raises(IsADirectoryError):
        open_file(pipe.parent)
    with pytest.raises(FileNotFoundError):
        open_file(pipe.with_name("none"))


def test_a_pipe_is_refused_also_where_a_file_was_a_moment_before(pipe: Path, monkeypatch):
    (file := pipe.with_name("file")).touch()
    before = os.stat(file)
    monkeypatch.setattr(os, "stat", lambda _: before)
    with pytest.raises(OSError, match="not a regular file"):
        open_file(pipe)


def test_what_the_shell_opened_is_read():
    reading, writing = os.pipe()
    os.write(writing, b"words")
    os.close(writing)
    try:
        assert read_file(f"/dev/fd/{reading}") == b"words"
    finally:
        os.close(reading)


def test_files_are_opened_nowhere_else():
    for path in sorted(ROOT.rglob("*.py")):
        text = path.read_text()
        if str(path.relative_to(ROOT)) in OWN or not _CALLS.search(text):
            continue
        for call in ast.walk(ast.parse(text)):
            if isinstance(call, ast.Call):
                assert not _opens(call), f"{path}:{call.lineno}: {ast.unparse(call)}"


def _opens(call: ast.Call) -> bool:
    """Whether it opens a file to read it."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else ast.unparse(call.func)
    texts = [one.value for one in call.args if isinstance(one, ast.Constant)]
    if name in ("read_bytes", "read_text"):
        return isinstance(call.func, ast.Attribute)
    is_own = ast.unparse(call.func) != "av.open"  # whose files are checked by themselves
    return name == "open" and is_own and any(text in ("r", "rb", "rt") for text in texts)
