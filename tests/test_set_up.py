"""`make demo` and `make test` on systems that lack something, with stand-ins for their programs."""

from __future__ import annotations

import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = ("Makefile", "pyproject.toml", "package.xml", "tests/constraints.txt")
PACKAGES = "tests/debian-packages.txt"
SYSTEM = ("make", "sh", "echo", "sed", "mkdir", "chmod", "touch", "cat")
OPENGL = "libegl1 libgl1 libgl1-mesa-dri"

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="needs make")

PYTHON = """#!/bin/sh
# Makes environments of its own kind: their pip and python end as $PIP and $DRAWING say.
case "$1 $2" in
    "-m venv")
        for folder; do :; done
        mkdir -p $folder/bin
        printf '#!/bin/sh\\necho no route to host\\nexit %s' "$PIP" >$folder/bin/pip
        printf '#!/bin/sh\\nexit %s' "$DRAWING" >$folder/bin/python
        printf '#!/bin/sh\\necho the demo plays' >$folder/bin/ros-visualise
        for tool in ruff mypy; do printf '#!/bin/sh' >$folder/bin/$tool; done
        printf '#!/bin/sh\\necho tests: "$@"' >$folder/bin/pytest
        chmod +x $folder/bin/*
        ;;
    "-c import rospy") exit 1 ;;
    "-c import ensurepip") exit "$VENV" ;;
    *) exec REAL "$@" ;;
esac
"""


class System:
    """A folder with this project, whose programs are those in ``bin``; nobody is at a terminal."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.bin = folder, folder / "bin"
        self.bin.mkdir()
        self.calls = folder / "calls"
        (folder / "tests").mkdir()
        for name in (*FILES, PACKAGES):
            shutil.copy(ROOT / name, folder / name)
        for name in SYSTEM:
            (self.bin / name).symlink_to(str(shutil.which(name)))
        self.add("python3", PYTHON.replace("REAL", sys.executable))
        self.add("id", "#!/bin/sh\necho 1000")

    def add(self, name: str, script: str) -> None:
        """Install a program."""
        file = self.bin / name
        file.write_text(script)
        file.chmod(file.stat().st_mode | stat.S_IXUSR)

    def add_recorded(self, name: str, script: str) -> None:
        """Install a program that notes how it was called."""
        self.add(name, f'#!/bin/sh\necho {name} "$@" >>{self.calls}\n{script}')

    def demo(
        self, venv: int = 0, pip: int = 0, opengl: int = 0, python: str = "python3"
    ) -> tuple[int, list[str]]:
        """Status and lines of ``make demo``."""
        environment = {"VENV": str(venv), "PIP": str(pip), "DRAWING": str(opengl)}
        return self.make("demo", f"PYTHON={python}", **environment)

    def test(self, *arguments: str, **environment: str) -> tuple[int, list[str]]:
        """Status and lines of ``make test``."""
        given = {"VENV": "0", "PIP": "0", "DRAWING": "0", **environment}
        return self.make("test", "PYTHON=python3", "ROS_PYTHON=python3", *arguments, **given)

    def make(self, *arguments: str, **environment: str) -> tuple[int, list[str]]:
        """Status and lines of ``make``."""
        run = subprocess.run(
            [self.bin / "make", *arguments],
            cwd=self.folder,
            env={"PATH": str(self.bin), **environment},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=60,
        )
        return run.returncode, run.stdout.splitlines()

    @property
    def called(self) -> list[str]:
        """What was called of the programs that note it."""
        return self.calls.read_text().splitlines() if self.calls.exists() else []

    @property
    def is_ready(self) -> bool:
        """Whether the set-up counts as done."""
        return (self.folder / ".venv" / ".ready").exists()


@pytest.fixture
def system(tmp_path: Path) -> System:
    return System(tmp_path)


def test_nothing_is_installed_where_nothing_is_missing(system: System) -> None:
    system.add_recorded("sudo", "exit 1")
    system.add_recorded("apt-get", "exit 1")
    assert system.demo() == (
        0,
        ["setting up in .venv, which takes a few minutes ...", "the demo plays"],
    )
    assert not system.called
    assert system.is_ready


def test_who_cannot_be_asked_is_not_and_the_demo_plays_without(system: System) -> None:
    system.add_recorded("sudo", "exit 1")
    system.add_recorded("apt-get", "exit 1")
    status, lines = system.demo(opengl=1)
    assert status == 0
    assert lines[1:] == [
        f"installing with apt-get: {OPENGL}",
        f"not installed: {OPENGL}",
        "the demo plays",
    ]
    assert [call.split()[:2] for call in system.called] == [["sudo", "-n"]]  # once


@pytest.mark.parametrize("missing", ["sudo", "apt-get"])
def test_a_system_without_sudo_or_apt_does_without_opengl(system: System, missing: str) -> None:
    there = "apt-get" if missing == "sudo" else "sudo"
    system.add_recorded(there, "exit 1")
    status, lines = system.demo(opengl=1)
    assert (status, lines[-2:]) == (0, [f"not installed: {OPENGL}", "the demo plays"])
    assert not system.called


def test_lists_of_packages_are_renewed_where_a_package_is_not_found(system: System) -> None:
    system.add("sudo", '#!/bin/sh\nshift\nexec "$@"')
    system.add_recorded("apt-get", f"grep -q update {system.calls}")
    (system.bin / "grep").symlink_to(str(shutil.which("grep")))
    status, lines = system.demo(venv=1)
    assert (status, lines[-1]) == (0, "the demo plays")
    assert [call.split()[1] for call in system.called[:3]] == ["install", "update", "install"]
    assert all(call.endswith("python3-venv") for call in system.called if "install" in call)


def test_a_python_that_is_too_old_is_one_line(system: System) -> None:
    old = "import sys; sys.version_info = (3, 9); exec(sys.argv[1])"
    system.add("old", f'#!/bin/sh\nexec {sys.executable} -c "{old}" "$2"')
    status, lines = system.demo(python="old")
    assert status == 2
    assert "older than 3.10; name another one by PYTHON=..." in lines[1]
    assert len(lines) == 3  # the last one is make's
    assert not (system.folder / ".venv").exists()


def test_packages_that_cannot_be_had_are_one_line_and_tried_again(system: System) -> None:
    status, lines = system.demo(pip=1)
    assert status == 2
    assert lines[1].startswith("cannot install the Python packages, which takes a network")
    assert len(lines) == 3
    assert (system.folder / ".venv" / "pip.log").read_text() == "no route to host\n"
    assert not system.is_ready
    assert system.demo()[1][-1] == "the demo plays"


DPKG = """#!/bin/sh
# Every package is installed but these.
shift 3
for name; do case " $ABSENT " in *" $name "*) ;; *) echo installed=$name ;; esac; done
"""


def test_missing_packages_are_named_before_they_are_installed(system: System) -> None:
    system.add("dpkg-query", DPKG)
    system.add("sudo", '#!/bin/sh\nshift\nexec "$@"')
    system.add_recorded("apt-get", "echo unpacking")
    status, lines = system.test(ABSENT="xvfb chromium")
    assert status == 0
    assert lines[:2] == ["installing with apt-get: chromium xvfb", "unpacking"]
    assert lines[-1] == "tests: -n 4 --dist loadfile --no-loadscope-reorder"
    [call] = system.called
    assert call.endswith("chromium xvfb")
    assert system.test(ABSENT="xvfb chromium")[1][-1] == lines[-1]
    assert system.called == [call]


@pytest.mark.parametrize("missing", ["sudo", "apt-get"])
def test_without_packages_the_other_tests_run(system: System, missing: str) -> None:
    system.add_recorded("apt-get" if missing == "sudo" else "sudo", "exit 1")
    status, lines = system.test(ABSENT="xvfb")
    assert status == 0
    assert lines[1].startswith("not installed: ")
    assert lines[2] == "the tests that need these are skipped"
    assert lines[-1].startswith("tests: ")
    assert not system.called


def test_without_packages_ci_fails(system: System) -> None:
    status, lines = system.test(CI="1")
    assert status == 2
    assert not any(line.startswith("tests: ") for line in lines)


def test_quick_tests_install_no_packages(system: System) -> None:
    system.add_recorded("sudo", "exit 1")
    system.add_recorded("apt-get", "exit 1")
    status, lines = system.test("QUICK=1")
    assert status == 0
    assert lines[-1].startswith("tests: -n 4 --dist loadfile --no-loadscope-reorder tests/")
    assert not system.called
    assert system.test("QUICK=1", "TESTS=tests/core/test_rate.py")[1][-1].endswith(
        " tests/core/test_rate.py"
    )
