"""Processes in sessions of their own, each with a log; nothing of them outlives the run."""

import contextlib
import os
import re
import signal
import socket
import subprocess
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

_END_S = 5.0
_POLL_S = 0.05
_ADDRESS = re.compile(r"open (https?://\S+)")


class Process:
    """A program that runs until it is ended.

    Args:
        name: of its log.
        command: what to run.
        folder: for its log; it also runs there.
        environment: instead of this process's own.
    """

    def __init__(
        self,
        name: str,
        command: Sequence[str | Path],
        folder: Path,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.log = folder / f"{name}.log"
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(
                [str(part) for part in command],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=environment,
                start_new_session=True,
            )
        self.pid = self._process.pid

    @property
    def has_ended(self) -> bool:
        """Whether it has; its number, and that of its group, are its own until `end_all`."""
        if self._process.returncode is not None:
            return True
        options = os.WEXITED | os.WNOHANG | os.WNOWAIT
        return os.waitid(os.P_PID, self.pid, options) is not None

    def address(self, timeout_s: float = 120.0) -> str:
        """Where its page is, as it says.

        Raises:
            SystemExit: it says nothing.
        """
        end_s = time.monotonic() + timeout_s
        while time.monotonic() < end_s and not self.has_ended:
            found = _ADDRESS.search(self.log.read_text(errors="replace"))
            if found:
                return found[1]
            time.sleep(_POLL_S)
        raise SystemExit(f"{self.log}: no page was opened")

    def wait(self) -> None:
        """Until it ends by itself.

        Raises:
            SystemExit: it did not end well.
        """
        while not self.has_ended:
            time.sleep(_POLL_S)
        if self._process.wait():
            raise SystemExit(f"{self.log}: ended with {self._process.returncode}")

    def last_line(self) -> str:
        """The last whole line that it printed."""
        with self.log.open("rb") as log:
            log.seek(max(0, self.log.stat().st_size - 2000))
            lines = log.read().decode(errors="replace").split("\n")
        return lines[-2] if len(lines) > 1 else ""

    def send(self, number: int) -> None:
        """Send a signal to it and to all that it started."""
        if self._process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.pid, number)

    def bury(self) -> int:
        """End what is left of it and of all that it started by force; its exit status."""
        self.send(signal.SIGKILL)
        return self._process.wait()


def end_all(processes: Iterable[Process]) -> None:
    """End processes as Ctrl-C would, all at once, and by force those that do not end."""
    several = list(processes)
    for process in several:
        process.send(signal.SIGINT)
    end_s = time.monotonic() + _END_S
    while time.monotonic() < end_s and not all(one.has_ended for one in several):
        time.sleep(_POLL_S)
    for process in several:
        process.bury()


def free_port() -> int:
    """A port of this machine that nobody uses."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])
