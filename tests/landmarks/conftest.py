"""The distribution's own Python, whose OpenCV is another version than the tests' own."""

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pyapriltags
import pytest

import ros_visualise

PYTHON = "/usr/bin/python3"


@pytest.fixture
def run_on_system_opencv(tmp_path: Path) -> Callable[..., str]:
    """Runs code there, with arguments; what it printed. Debian 12 has OpenCV 4.6."""
    try:
        lacks = subprocess.run([PYTHON, "-c", "import cv2"], capture_output=True).returncode != 0
    except FileNotFoundError:
        lacks = True
    if lacks and os.environ.get("CI"):
        pytest.fail("no OpenCV of the system's: apt-get install python3-opencv")
    if lacks:
        pytest.skip("no OpenCV of the system's: apt-get install python3-opencv, to run this")
    (tmp_path / "pyapriltags").symlink_to(Path(pyapriltags.__file__).parent)
    paths = f"{Path(ros_visualise.__file__).parents[1]}:{tmp_path}"

    def run(code: str, *arguments: str) -> str:
        done = subprocess.run(
            [PYTHON, "-c", code, *arguments],
            env={"PYTHONPATH": paths},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run
