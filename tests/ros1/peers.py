"""Other nodes of the graph, for the tests of the transport."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ros_graph import Master, end, wait_for

PEER = Path(__file__).with_name("peer.py")


class Peer:
    """``peer.py`` in a process of its own, and what it has told."""

    def __init__(self, master: Master, *args: str) -> None:
        self.told: list[list[Any]] = []
        self.said: list[str] = []
        self.process = master.run(sys.executable, str(PEER), *args)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def numbers(self) -> list[int]:
        """Those of the messages that it was given, all of which were whole."""
        assert all(whole for *_, whole in self.told)
        return [number for _, number, *_ in self.told]

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def wait(self) -> int:
        """Wait until it ends by itself; its exit status."""
        return self.process.wait(60)

    def stop(self) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
            self.process.wait()
        self._reader.join(60)
        assert self.process.stdout is not None
        self.process.stdout.close()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith("["):
                self.told.append(json.loads(line))
            else:
                self.said.append(line)


class Peers:
    """Starts peers, and ends them all."""

    def __init__(self, master: Master) -> None:
        self._master = master
        self._peers: list[Peer] = []

    def start(self, *args: object) -> Peer:
        self._peers.append(Peer(self._master, *map(str, args)))
        return self._peers[-1]

    def stop(self) -> None:
        for peer in self._peers:
            peer.stop()


@contextmanager
def running(master: Master, *command: str, **options: Any) -> Iterator[subprocess.Popen[str]]:
    """A tool or a node in C++, ended at the end."""
    process = master.run(*command, **options)
    try:
        yield process
    finally:
        end(process)


def connect(publisher: Any, count: int = 1) -> None:
    """Wait until a publisher has so many subscribers."""
    wait_for(lambda: publisher.connections == count, f"{count} at {publisher.name}")
