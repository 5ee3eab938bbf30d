"""Someone new to the machine, who types the documentation's commands."""

from __future__ import annotations

import fcntl
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from documents import PACKAGE

_CLONE = "git clone ADDRESS "
_OF_THE_TESTS = re.compile("PIP_CONSTRAINT|PYTHON|VIRTUAL_ENV|CMAKE_|ROS|DISPLAY|WAYLAND_")
_PACKAGES = f"""hatchling editables '{PACKAGE}[headless,sim,detect]'"""
_BESIDE_DEBIAN = """--no-deps 'numpy<2; python_version<"3.13"'"""  # as the extra ``system`` has it
_SUDO = """#!/bin/sh
# What `sudo apt install ...` would do: tests/debian-packages.txt has been installed already.
shift
exec apt-get --simulate "$@"
"""


class Newcomer:
    """A user with an empty home and nothing of the tests' environment.

    pip installs the newest packages, which are downloaded once for all tests: most of its time goes
    to choosing among the thousands of files of an index. Without the network a test is skipped, and
    fails in CI. The documented address of the repository leads to this one, with uncommitted
    changes.

    Args:
        home: an empty folder.
        temporary: gives the folder of the packages.
        environment: further variables.
    """

    def __init__(self, home: Path, temporary: pytest.TempPathFactory, **environment: str) -> None:
        self.home = home
        self.environment = {
            **{name: of for name, of in os.environ.items() if not _OF_THE_TESTS.match(name)},
            **environment,
            "HOME": str(home),
            "PATH": f"{home}/bin:/usr/bin:/bin",
            "PIP_NO_COMPILE": "0",  # says "no" (!): Python compiles what is imported, a small part
        }
        sudo = home / "bin" / "sudo"
        sudo.parent.mkdir()
        sudo.write_text(_SUDO)
        sudo.chmod(0o755)
        self._make_repository()
        folder = temporary.getbasetemp()  # of this process of the tests
        self._download(folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder)

    def run(self, script: str, folder: str = "", status: int = 0) -> str:
        """Output of commands that end with this status; the first that fails ends them."""
        process = self.start(script, folder)
        printed = process.communicate()[0]
        assert process.returncode == status, f"{script}\n{printed}"
        return printed

    def start(self, script: str, folder: str = "") -> subprocess.Popen[str]:
        """Commands that run until `stop`."""
        script = script.replace(_CLONE, f"git clone file://{self.home}/repository ")
        return subprocess.Popen(
            ["bash", "-e", "-c", script],
            cwd=self.home / folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,  # a job of its own, as in a terminal
        )

    def _download(self, shared: Path) -> None:
        wheels = shared / "wheels"
        download = f"{sys.executable} -m pip --retries 0 download --quiet --dest {wheels}"
        with (shared / "wheels.lock").open("a+") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not lock.tell():
                try:
                    self.run(f"{download} {_PACKAGES}; {download} {_BESIDE_DEBIAN}")
                except AssertionError as error:
                    fault = f"cannot download the newest packages: {error}"
                    pytest.fail(fault) if os.environ.get("CI") else pytest.skip(fault)
                lock.write("done")
        self.environment.update(PIP_NO_INDEX="1", PIP_FIND_LINKS=str(wheels))

    def _make_repository(self) -> None:
        git = f"git --git-dir=repository --work-tree='{PACKAGE}' -c user.name=A -c user.email=a@b"
        self.run(
            f"git init --quiet --bare repository; {git} add --all;"
            f" {git} -c core.bare=false commit --quiet --message=All"
        )


def stop(process: subprocess.Popen[str]) -> str:
    """Output of a job, which is ended by Ctrl-C if it still runs."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGINT)
    return process.communicate(timeout=60)[0]
