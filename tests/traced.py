"""A process's traces: whom it asked on the network, and what it wrote, as the kernel saw it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

CALLS = (
    "connect,sendto,sendmsg,sendmmsg,open,openat,openat2,creat,truncate,mkdir,mkdirat,mknod,"
    "mknodat,rename,renameat,renameat2,link,linkat,symlink,symlinkat,unlink,unlinkat,rmdir"
)
_LINE = re.compile(r"\d+ +(?P<call>\w+)\((?P<given>.*)\)\s+= (?P<result>-?\d+)")
_PATH = re.compile(r'(?:(?:AT_FDCWD|\d+)<(?P<folder>[^>]*)>, )?"(?P<name>(?:[^"\\]|\\.)*)"')
_ADDRESS = re.compile(r"sa_family=(AF_INET6?|AF_NETLINK)")
_WRITES = re.compile(r"O_WRONLY|O_RDWR|O_CREAT|O_TRUNC")
_RENAMED = (
    "import os, socket, sys; socket.sethostname('nobody-knows-it');"
    " os.execvp(sys.argv[1], sys.argv[1:])"
)
_APART = ["unshare", "--map-root-user", "--net", "--uts", sys.executable, "-c", _RENAMED]
"""Runs a command in a network without routes, on a machine whose name only a look-up could tell."""
_NOWHERE = ("/dev/", "/proc/self/", "/memfd:")


class Traces(NamedTuple):
    """What a process and its children did.

    Attributes:
        asked: calls that address others on a network, also those that failed.
        written: files and folders that were made, written, renamed or removed.
    """

    asked: list[str]
    written: set[Path]


def trace(
    command: Sequence[str],
    folder: Path,
    environment: Mapping[str, str],
    log: Path,
    within: Sequence[str] = (),
) -> tuple[subprocess.CompletedProcess[str], Traces]:
    """Run a command to its end, in a network that leads nowhere.

    Args:
        command: the program, and what it is given.
        folder: it runs in.
        environment: all of it.
        log: a new file.
        within: a program that runs it, and is not watched.
    """
    watch = ["strace", "-f", "-qq", "-y", "-s", "4096", "--seccomp-bpf", "-o", str(log)]
    watch += ["-e", f"trace={CALLS}"]
    done = subprocess.run(
        [*_APART, *within, *watch, *command],
        cwd=folder,
        env=dict(environment),
        capture_output=True,
        text=True,
    )
    return done, _read(_whole_lines(log.read_text(errors="replace")), folder)


def can_trace() -> bool:
    """Whether this machine lets a process be watched, and cut off from the network."""
    try:
        command = [*_APART, "strace", "-f", "-qq", "-o", os.devnull, "true"]
        return subprocess.run(command, capture_output=True).returncode == 0
    except FileNotFoundError:
        return False


def _whole_lines(log: str) -> Iterator[str]:
    """A call that others came in between of is on two lines."""
    begun: dict[str, str] = {}
    for line in log.splitlines():
        process = line.partition(" ")[0]
        if line.endswith("<unfinished ...>"):
            begun[process] = line.removesuffix("<unfinished ...>")
        elif " resumed>" in line:
            yield begun.pop(process, f"{process} ") + line.partition(" resumed>")[2]
        else:
            yield line


def _read(lines: Iterator[str], folder: Path) -> Traces:
    traces = Traces([], set())
    for line in lines:
        found = _LINE.match(line)
        if found is None:
            continue
        call, given = found["call"], found["given"]
        if call in ("connect", "sendto", "sendmsg", "sendmmsg"):
            if _ADDRESS.search(given):
                traces.asked.append(line)
        elif int(found["result"]) >= 0 and ("open" not in call or _WRITES.search(given)):
            paths = list(_paths(given, folder))
            traces.written.update(paths[-1:] if call.startswith("symlink") else paths)
    return traces


def _paths(given: str, folder: Path) -> Iterator[Path]:
    """The paths in what a call was given, by a process in that folder."""
    for found in _PATH.finditer(given):
        path = Path(os.path.normpath(folder / (found["folder"] or "") / found["name"]))
        if not str(path).startswith(_NOWHERE) and "__pycache__" not in path.parts:
            yield path
