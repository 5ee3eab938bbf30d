"""Each tutorial works from its own text: files are written, commands run, outputs compared."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from documents import DOCUMENTS, PACKAGE, steps

from ros_visualise.commands import COMMANDS, main
from ros_visualise.running.options import PlayingOptions

TUTORIALS = [one for one in DOCUMENTS if one.parent.name == "tutorials" and one.stem != "index"]
QUICKLY = ["--view", "none", "--rate", "0", "--duration", "1"]
"""Options of a command that would open a page."""

ELSEWHERE = ("pip", "make", "roslaunch", "rosrun", "rosbag", "ros2", "sudo", ".venv-train/bin/pip")
"""Programs whose calls other tests make."""


@pytest.mark.parametrize("tutorial", TUTORIALS, ids=lambda path: path.stem)
@pytest.mark.usefixtures("opengl")
def test_tutorial_works_as_it_is_written(tutorial, recordings, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    given(recordings, tmp_path)
    printed = ""
    for kind, text, name in steps(tutorial):
        if kind in ("python", "yaml", "xml"):
            Path(name).write_text(text)
        elif kind == "text":
            shown = lines(printed)
            assert [one for one in lines(text) if not any(one in line for line in shown)] == [], (
                printed
            )
        elif kind == "sh":
            for line in text.splitlines():
                assert run(line) == (2 if line.endswith("# fails") else 0), line
            printed = "\n".join(capfd.readouterr())


def given(recordings: Path, folder: Path) -> None:
    """Files of the reader's own: photos of a board, the repository's scripts, a trained network."""
    shutil.copytree(recordings / "calib" / "opencv", folder / "photos", ignore=only_left)
    (folder / "training").symlink_to(PACKAGE / "training")
    (folder / "out").mkdir()
    models = PACKAGE / "src" / "ros_visualise" / "landmarks" / "networks" / "models"
    (folder / "out" / "aerial.onnx").symlink_to(models / "aerial.onnx")


def only_left(_: str, names: list[str]) -> list[str]:
    return [name for name in names if not re.fullmatch(r"left\d+\.jpg", name)]


def lines(text: str) -> list[str]:
    """The lines with one blank between words, and N for each number."""
    return [re.sub(r"\d+(\.\d+)?", "N", " ".join(line.split())) for line in text.splitlines()]


def run(line: str) -> int:
    """Exit status of a command, in this process where it is ours."""
    program, *words = shlex.split(line, comments=True)
    comment = line.partition("   # ")[2]
    if program in ELSEWHERE or comment.startswith(("needs", "with", "on")):
        return 0
    if program == "python":
        return subprocess.run([sys.executable, *words], check=False).returncode
    assert program == "ros-visualise", line
    plays = issubclass(COMMANDS.find(words[0]).options, PlayingOptions)
    is_cut = comment.startswith("takes") or "none" not in words
    return main([*words, *(QUICKLY if plays and is_cut else [])])
