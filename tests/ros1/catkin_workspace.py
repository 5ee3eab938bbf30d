"""A catkin workspace that holds this package, built with the interpreter that runs the tests."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

PACKAGE = Path(__file__).parents[2]


class Workspace:
    """A fresh workspace, built for the environment in which it is used."""

    def __init__(self, folder: Path, environment: Mapping[str, str]) -> None:
        self.folder = folder
        self._outside = dict(environment)
        (folder / "src").mkdir(parents=True)
        (folder / "src" / "ros_visualise").symlink_to(PACKAGE)
        self._make()
        self.environment = self.set_up("devel")

    def install(self) -> None:
        """Build its install space too."""
        self._make("install")

    def set_up(self, space: str) -> dict[str, str]:
        """The environment after ``source SPACE/setup.bash``."""
        command = f'source "{self.folder / space}/setup.bash" && env -0'
        done = subprocess.run(
            ["bash", "-c", command], env=self._outside, text=True, capture_output=True, timeout=60
        )
        assert done.returncode == 0, done.stderr
        return dict(line.split("=", 1) for line in done.stdout.split("\0") if line)

    def _make(self, *targets: str) -> None:
        interpreter = f"-DPYTHON_EXECUTABLE={sys.executable}"
        done = subprocess.run(
            ["catkin_make", "-C", str(self.folder), interpreter, *targets],
            env=self._outside,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=300,
        )
        assert done.returncode == 0, done.stdout
