"""What does not fit together, or was not installed, is one line that says what to install."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from catkin_workspace import PACKAGE

from ros_visualise.running.executables import command_of

ADVICE = (
    f"this OpenCV was not built for NumPy {np.__version__}: {sys.executable} -m pip install"
    " 'numpy<2'"
)


@pytest.fixture(scope="module")
def mismatch(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """An environment in which the distribution's OpenCV is found before pip's."""
    where = "from importlib.util import find_spec; print(find_spec('cv2').origin)"
    of_debian = Path(run(dict(os.environ), "/usr/bin/python3", "-I", "-c", where).stdout.strip())
    folder = tmp_path_factory.mktemp("distribution")
    (folder / of_debian.name).symlink_to(of_debian)
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    if run(environment, sys.executable, "-c", "import cv2").returncode == 0:
        pytest.skip("here the distribution's OpenCV fits to the newest NumPy")
    return environment


def run(environment: dict[str, str], *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, env=environment, text=True, capture_output=True, timeout=60)


@pytest.mark.parametrize("arguments", [("nodes",), ("info", "x.bag"), ("video", "x.mp4")])
def test_command_ends_with_it(mismatch, arguments):
    done = run(mismatch, sys.executable, "-m", "ros_visualise", *arguments)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"ros-visualise: {ADVICE}\n")


@pytest.mark.parametrize("name", ["streamer", "edge_detector"])
def test_executable_ends_with_it(mismatch, name):
    done = run(mismatch, *command_of(name))
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"{name}: {ADVICE}\n")


def test_catkin_says_it(mismatch, tmp_path):
    interpreter = f"-DPYTHON_EXECUTABLE={sys.executable}"
    done = run(mismatch, "cmake", "-S", str(PACKAGE), "-B", str(tmp_path), interpreter)
    assert done.returncode == 0
    assert "CMake Warning at CMakeLists.txt:" in done.stderr
    assert f"ros-visualise: {ADVICE}\n" in done.stderr


def test_missing_packages_are_named():
    """To Debian's own Python, where nobody has called pip."""
    source = str(PACKAGE / "src")
    environment = {**os.environ, "PYTHONPATH": source, "PYTHONNOUSERSITE": "1"}
    done = run(environment, "/usr/bin/python3", *command_of("filters")[1:])
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith("filters: not installed: ")
    assert done.stderr.endswith(
        "nicegui; in a workspace, /usr/bin/python3 -m pip install --user --break-system-packages"
        " -e 'src/ros_visualise[system,sim,detect]'\n"
    )
