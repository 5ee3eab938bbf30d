"""Every node of this package has an executable, whose names CMake asks for before pip has run."""

from __future__ import annotations

import subprocess
import sys

from launched import PACKAGE

from ros_visualise.nodes import NODES
from ros_visualise.running.executables import names


def test_every_node_and_source_has_one():
    assert names() == sorted([*NODES.builtin, "node", "pipeline", "viewer"])


def test_their_names_need_nothing_but_python():
    done = subprocess.run(
        [
            sys.executable,
            "-S",
            "-m",
            "ros_visualise.running.executables",
        ],  # without packages of pip
        cwd=PACKAGE / "src",
        text=True,
        capture_output=True,
        timeout=60,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == names()
