"""The examples of the gallery run by the commands in their texts; so do short answers."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from documents import DOCUMENTS, PACKAGE, steps
from reader import LENT, lend, run

from ros_visualise.commands import main

EXAMPLES = sorted((PACKAGE / "examples").glob("[0-9]*.py"))
LONGEST = 60
"""Lines of an example, which is read in one go."""

DRIVE = "sim husky --world playpen --mission square --duration 10 --view none --rate 0"
DRIVE += " --set husky.camera=false --set husky.lidar=false --record drive.bag"
CHEAP = ("info", "convert", "trajectory", "calibrate", "tags", "plugins")
"""Commands of answers that take less than a second."""

OTHERS = ("damaged.", "imu.bag", "other.tum", "2011_", "/dev/", "--output", "/camera/", "/tracks")
"""Words of commands that take files which the reader here lacks."""

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


@pytest.mark.usefixtures("opengl")
def test_cheap_answers_work(folder: Path, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("drive.bag", "flight.mp4"):
        (tmp_path / name).symlink_to(folder / name)
    assert main(["trajectory", "drive.bag", "gt.tum", "--topic", "/ground_truth/odom"]) == 0
    blocks = [
        text for path in DOCUMENTS if path.parent.name == "howto" for _, text, _ in steps(path)
    ]
    lines = [line for text in blocks for line in text.splitlines()]
    ours = [
        line for line in lines if line.startswith(tuple(f"ros-visualise {one} " for one in CHEAP))
    ]
    run_here = [line for line in ours if not any(word in line for word in OTHERS)]
    assert len(run_here) > 12
    for line in run_here:
        assert run(line, monkeypatch) == 0, line
