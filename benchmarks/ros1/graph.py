"""A ROS graph of its own, and the processes in it; nothing of it outlives the benchmark."""

import contextlib
import os
import signal
import socket
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

_END_S = 3.0


class Graph:
    """Starts processes in a graph with a master of its own, so that nothing is left from before.

    Args:
        scratch: where logs and ROS's own files go.
        port: of the master; 0 takes a free one.
    """

    def __init__(self, scratch: Path, port: int = 0) -> None:
        self.scratch = scratch
        self._port = port or _free_port()
        self._started = 0
        self.environment = {
            **os.environ,
            "ROS_MASTER_URI": f"http://127.0.0.1:{self._port}",
            "ROS_IP": "127.0.0.1",
            "ROS_HOME": str(scratch / "ros_home"),
            "PYTHONUNBUFFERED": "1",
        }
        os.environ.update(self.environment)

    @contextlib.contextmanager
    def running(self, *commands: Sequence[str | Path]) -> Iterator[list[int]]:
        """A master and these processes while they are needed; gives the processes' ids."""
        processes = [self._start(["roscore", "-p", str(self._port)])]
        try:
            self._wait_for_master()
            for command in commands:
                processes.append(self._start(command))
            yield [process.pid for process in processes[1:]]
            for process in processes:
                if process.poll() is not None:
                    print(f"ended early ({process.returncode}): {_text(process)}")
                    print(self._log(process).read_text()[-2000:])
        finally:
            self._stop(processes[1:])
            self._stop(processes[:1])

    def _wait_for_master(self) -> None:
        end_s = time.monotonic() + 20
        while time.monotonic() < end_s:
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self._port)):
                return
            time.sleep(0.05)
        raise SystemExit("roscore did not start")

    def _start(self, command: Sequence[str | Path]) -> subprocess.Popen[bytes]:
        self._started += 1
        path = self.scratch / f"{self._started:03d}.log"
        with path.open("wb") as log:
            process = subprocess.Popen(
                [str(part) for part in command],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=self.environment,
                start_new_session=True,
            )
        process.log = path  # type: ignore[attr-defined]
        return process

    def _log(self, process: subprocess.Popen[bytes]) -> Path:
        path: Path = process.log  # type: ignore[attr-defined]
        return path

    def _stop(self, processes: list[subprocess.Popen[bytes]]) -> None:
        for process in processes:
            _signal(process, signal.SIGINT)
        end_s = time.monotonic() + _END_S
        try:
            for process in processes:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(max(0.0, end_s - time.monotonic()))
        finally:
            for process in processes:
                _signal(process, signal.SIGKILL)
                process.wait()


def _signal(process: subprocess.Popen[bytes], number: int) -> None:
    """Send a signal to the process and to all that it started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, number)


def _text(process: subprocess.Popen[bytes]) -> str:
    return " ".join(str(part) for part in process.args)  # type: ignore[union-attr]


def _free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])
