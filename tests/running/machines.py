"""Two machines, as network namespaces of this one."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest

_ADDRESSES = "10.213.7.1", "10.213.7.2"
_MISSING = "two machines are two network namespaces, which need root and iproute2 (ip netns)"


class Machine:
    """A machine with an address of its own.

    Args:
        namespace: its network namespace.
        address: the other machine reaches it there.
    """

    def __init__(self, namespace: str, address: str) -> None:
        self.address = address
        self._inside = "ip", "netns", "exec", namespace
        self._started: list[subprocess.Popen[str]] = []

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        """Start a command of ours."""
        return self.run([sys.executable, "-m", "ros_visualise", *arguments])

    def run(self, command: Sequence[str]) -> subprocess.Popen[str]:
        """Start any command."""
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        process = subprocess.Popen([*self._inside, *command], text=True, **pipes)  # type: ignore[call-overload]
        self._started.append(process)
        return process

    def stop(self) -> None:
        """Kill what still runs."""
        for process in self._started:
            process.kill()
            process.wait()
            for stream in (process.stdout, process.stderr):
                if stream is not None:
                    stream.close()


@contextmanager
def two_machines() -> Iterator[tuple[Machine, Machine]]:
    """Two machines with a cable between them, until the end of the block."""
    names = [f"rv{os.getpid()}{letter}" for letter in "ab"]
    try:
        _make(names)
    except (OSError, subprocess.CalledProcessError):
        for name in names:
            subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True)
        if os.environ.get("CI"):
            pytest.fail(_MISSING)
        pytest.skip(_MISSING)
    first, second = map(Machine, names, _ADDRESSES)
    try:
        yield first, second
    finally:
        first.stop()
        second.stop()
        for name in names:
            _ip("netns", "del", name)


def _make(names: Sequence[str]) -> None:
    if shutil.which("ip") is None:
        raise OSError(_MISSING)
    for name in names:
        _ip("netns", "add", name)
    first, second = names
    peer = ("peer", "name", "wire", "netns", second)
    _ip("link", "add", "wire", "netns", first, "type", "veth", *peer)
    for name, address in zip(names, _ADDRESSES, strict=True):
        _ip("-n", name, "link", "set", "lo", "up")
        _ip("-n", name, "addr", "add", f"{address}/30", "dev", "wire")
        _ip("-n", name, "link", "set", "wire", "up")


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True)
