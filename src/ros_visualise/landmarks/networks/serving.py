"""A process that runs networks for others, the images of several in one batch.

It has one thread, so that it answers to nothing while a network hangs: whoever started it sees that
by a ``ping``, and ends it.
"""

from __future__ import annotations

import mmap
import os
import time
from collections.abc import Hashable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, Listener, wait
from multiprocessing.reduction import recv_handle
from typing import Any, NamedTuple

from ros_visualise.core.errors import OpenError
from ros_visualise.landmarks.networks.batches import Inputs, group_of, run_together
from ros_visualise.landmarks.networks.remote import Opened, ServerAddress, SharedArray
from ros_visualise.landmarks.networks.session import OnnxSession, Provider

MOST_IMAGES = 32
"""The largest batch."""
_GATHER_S = 0.003
"""Time that an image waits for others."""


class _Request(NamedTuple):
    client: Connection
    session: OnnxSession
    inputs: Inputs
    names: list[str]


@dataclass
class _Client:
    """What a client has opened and shared."""

    session: OnnxSession | None = None
    memory: mmap.mmap | None = None


class NetworkServer:
    """Networks for the processes that connect to a socket.

    Args:
        address: of the socket, which is made, and the key that clients need.
        provider: hardware to run on.
        threads: number of threads, if that is the CPU.
        gpu: its number, if there are several.
    """

    def __init__(self, address: ServerAddress, provider: Provider, threads: int, gpu: int) -> None:
        self._how = provider, threads, gpu
        with suppress(FileNotFoundError):
            os.unlink(address.path)
        self._listener = Listener(address.path, "AF_UNIX", authkey=address.key)
        self._clients: dict[Connection, _Client] = {}
        self._sessions: dict[tuple[str, int, int], OnnxSession] = {}
        self._waiting: list[_Request] = []

    def serve(self) -> None:
        """Serve until the process ends."""
        while True:
            self._receive(None)
            end_s = time.monotonic() + _GATHER_S
            while self._waiting and self._may_grow() and time.monotonic() < end_s:
                self._receive(end_s - time.monotonic())
            self._answer()

    def _may_grow(self) -> bool:
        """True while a client without a request could add one to the batch."""
        asking = sum(one.session is not None for one in self._clients.values())
        return len(self._waiting) < min(MOST_IMAGES, asking)

    def _receive(self, timeout_s: float | None) -> None:
        entrance: Any = self._listener._listener._socket  # type: ignore[attr-defined]
        for one in wait([entrance, *self._clients], timeout_s):
            if one is entrance:
                with suppress(OSError, EOFError):  # a wrong key, or gone already
                    self._clients[self._listener.accept()] = _Client()
                continue
            assert isinstance(one, Connection)
            try:
                self._handle(one, one.recv())
            except (OSError, EOFError):
                self._forget(one)

    def _handle(self, client: Connection, request: tuple[Any, ...]) -> None:
        kind, *rest = request
        known = self._clients[client]
        if kind == "ping":
            client.send("pong")
        elif kind == "open":
            client.send(self._open(known, *rest))
        elif kind == "share":
            handle = recv_handle(client)
            known.memory = mmap.mmap(handle, rest[0])
            os.close(handle)
            client.send(None)
        else:
            assert known.session is not None
            assert known.memory is not None
            places: dict[str, SharedArray] = rest[0]
            inputs = {name: place.of(known.memory) for name, place in places.items()}
            self._waiting.append(_Request(client, known.session, inputs, rest[1]))

    def _open(self, client: _Client, path: str) -> Opened | OpenError:
        try:
            status = os.stat(path) if os.path.isfile(path) else None
            file = path, status.st_mtime_ns if status else 0, status.st_size if status else 0
            if file not in self._sessions:
                self._sessions[file] = OnnxSession(path, *self._how)
        except OpenError as error:
            return error
        found = client.session = self._sessions[file]
        return Opened(found.inputs, found.optional, found.outputs, dict(found.metadata))

    def _answer(self) -> None:
        """Run what waits, batch by batch."""
        groups: dict[Hashable, list[_Request]] = {}
        for number, one in enumerate(self._waiting):
            key = group_of(one.session, one.inputs, one.names)
            groups.setdefault(number if key is None else key, []).append(one)
        self._waiting = []
        for group in groups.values():
            for first in range(0, len(group), MOST_IMAGES):
                self._run(group[first : first + MOST_IMAGES])

    def _run(self, batch: list[_Request]) -> None:
        inputs = [one.inputs for one in batch]
        answers = run_together(batch[0].session, inputs, batch[0].names)
        for one, answer in zip(batch, answers, strict=True):
            try:
                one.client.send(answer)
            except OSError:
                self._forget(one.client)

    def _forget(self, client: Connection) -> None:
        """Close what a client left, which may have been killed."""
        self._clients.pop(client, None)
        client.close()
