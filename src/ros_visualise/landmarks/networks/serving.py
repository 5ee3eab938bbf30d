"""A process that runs networks for others, the images of several in one batch.

GPUs prepare anew for each size of a batch. So there a batch is filled up to the next power of two,
and each size has a copy of the network that is ready for it.

It has one thread, so that it answers nothing while a network hangs: the process that started it
sees that by a ``ping``, and ends it.
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
from ros_visualise.landmarks.networks.batches import Inputs, Room, group_of, run_together
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
    """The networks and memory that a client has opened and shared."""

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
        self._fills = provider is Provider.CUDA
        with suppress(FileNotFoundError):
            os.unlink(address.path)
        self._listener = Listener(address.path, "AF_UNIX", authkey=address.key)
        self._clients: dict[Connection, _Client] = {}
        self._sessions: dict[tuple[Any, ...], OnnxSession] = {}
        self._waiting: list[_Request] = []
        self._room: Room = {}

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
            os.set_blocking(client.fileno(), True)  # it takes rospy's timeout
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
            found = client.session = self._session(path)
        except OpenError as error:
            return error
        return Opened(found.inputs, found.optional, found.outputs, dict(found.metadata))

    def _session(self, path: str, *sizes: int) -> OnnxSession:
        """A network, and copies of it for several sizes; it is opened anew if its file changed."""
        status = os.stat(path) if os.path.isfile(path) else None
        key = (path, status and (status.st_mtime_ns, status.st_size), *sizes)
        if key not in self._sessions:
            self._sessions[key] = OnnxSession(path, *self._how)
        return self._sessions[key]

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
        session, names = batch[0].session, batch[0].names
        inputs = [one.inputs for one in batch]
        if self._fills and len(batch) > 1:
            size = 1 << (len(batch) - 1).bit_length()
            inputs += inputs[-1:] * (size - len(batch))
            with suppress(OpenError):  # not enough memory for a copy
                session = self._session(session.path, size)
        answers = run_together(session, inputs, names, self._room)
        for one, answer in zip(batch, answers, strict=False):
            try:
                one.client.send(answer)
            except OSError:
                self._forget(one.client)

    def _forget(self, client: Connection) -> None:
        """Close what a client left, which may have been killed."""
        self._clients.pop(client, None)
        client.close()
