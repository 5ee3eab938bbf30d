"""Each example of the gallery runs by the commands in its own text."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from documents import PACKAGE
from reader import LENT, lend, run

from ros_visualise.commands import main

EXAMPLES = sorted((PACKAGE / "examples").glob("[0-9]*.py"))
LONGEST = 60
"""Lines of an example, which is read in one go."""

DRIVE = "sim husky --world playpen --mission square --duration 10 --view none --rate 0"
DRIVE += " --set husky.camera=false --set husky.lidar=false --record drive.bag"
SHOWS_A_PAGE = "21_own_page"  # until Ctrl-C: tests/test_examples.py


@pytest.fixture(scope="module")
def folder(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a film, a bag, photos and the examples."""
    folder = tmp_path_factory.mktemp("gallery")
    lend(recordings, folder)
    for name, recording in LENT.items():
        (folder / name).symlink_to(recordings / recording)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(DRIVE.split()) == 0
    return folder


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
@pytest.mark.usefixtures("opengl")
def test_example_runs_by_its_own_commands(example: Path, folder: Path, monkeypatch):
    monkeypatch.chdir(folder)
    text = example.read_text()
    assert len(text.splitlines()) <= LONGEST
    docstring = ast.get_docstring(ast.parse(text)) or ""
    lines = docstring.replace("\\\n", " ").splitlines()
    commands = [one for one in lines if one.startswith(("ros-visualise ", "python ", "rosrun "))]
    assert commands
    for line in commands if example.stem != SHOWS_A_PAGE else []:
        assert run(line, monkeypatch) == 0, line
