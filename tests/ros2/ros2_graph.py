"""Processes of a ROS 2 graph for the tests."""

from __future__ import annotations

import os
import subprocess
from typing import Any

from ros_visualise.running.executables import command_of

_END_S = 20


class Nodes2:
    """Our executables as processes of the graph that the environment names."""

    def __init__(self) -> None:
        self._started: list[subprocess.Popen[str]] = []

    def start(self, name: str, *args: str, **given: Any) -> subprocess.Popen[str]:
        """``start("filters", gray=False)``; names with ``__`` for a dot."""
        told = [f"{key.replace('__', '.')}:={_written(value)}" for key, value in given.items()]
        options = [part for one in told for part in ("-p", one)]
        process = subprocess.Popen(
            [*command_of(name), *args, "--ros-args", *options],
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        self._started.append(process)
        return process

    def end(self, process: subprocess.Popen[str]) -> tuple[int, str]:
        """End one of them, which may have failed; its exit status, and what it said."""
        self._started.remove(process)
        process.terminate()
        said, _ = process.communicate(timeout=_END_S)
        return process.returncode, said

    def stop(self) -> None:
        """End all of them."""
        for process in self._started:
            process.terminate()
        for process in self._started:
            said, _ = process.communicate(timeout=_END_S)
            assert process.returncode in (0, 1), said
            assert "Traceback" not in said, said


def _written(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
