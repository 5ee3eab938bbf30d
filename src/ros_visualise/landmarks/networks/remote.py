"""Networks that run in another process on this machine, which serves several at once.

`use` names the process to ask; from then on `open_session` asks it for networks on a GPU. Images
reach it through shared memory, the rest as pickles over a Unix socket with a key.
"""

from __future__ import annotations

import mmap
import os
import tempfile
import time
from collections.abc import Callable
from multiprocessing.connection import Client, Connection
from multiprocessing.reduction import send_handle
from typing import Any, NamedTuple, NoReturn

import numpy as np

from ros_visualise.core.errors import OpenError, RosVisualiseError
from ros_visualise.landmarks.networks.session import OnnxSession, Provider, Session, TensorPort

_PATIENCE_S = 60.0
_AGAIN_S = 0.1
_ALIGNMENT = 64  # bytes, as processors like it


class ServerAddress(NamedTuple):
    """The path of a server's socket, and the key that it asks for."""

    path: str
    key: bytes


class Opened(NamedTuple):
    """A server's answer: what it knows of a network."""

    inputs: tuple[TensorPort, ...]
    optional: tuple[TensorPort, ...]
    outputs: tuple[TensorPort, ...]
    metadata: dict[str, str]


class SharedArray(NamedTuple):
    """An array in the shared memory: where it begins, its type and its shape."""

    offset: int
    dtype: str
    shape: tuple[int, ...]

    def of(self, memory: mmap.mmap) -> Any:
        """The array itself, without a copy."""
        count = int(np.prod(self.shape))
        array = np.frombuffer(memory, self.dtype, count, self.offset)
        return array.reshape(self.shape)


_used: tuple[ServerAddress, Callable[[str], object]] | None = None


def use(server: ServerAddress, lost: Callable[[str], object]) -> None:
    """Let a server run the networks of this process that are to be on a GPU.

    Args:
        server: where it listens.
        lost: called with a reason if it ends before its answer; it need not return.
    """
    global _used
    _used = server, lost


def is_served() -> bool:
    """True if a server runs networks for this process."""
    return _used is not None


def open_session(path: str, provider: Provider, threads: int) -> Session:
    """A network, in this process or in the server that runs those on a GPU.

    Raises:
        OpenError: as `OnnxSession`.
    """
    if _used and provider is Provider.CUDA:
        return RemoteSession(path, *_used)
    return OnnxSession(path, provider, threads)


class RemoteSession:
    """A network in a server, used as `OnnxSession`.

    Args:
        path: the file.
        server, lost: as `use` takes them.

    Raises:
        OpenError: as `OnnxSession`.
        RosVisualiseError: the server is lost.
    """

    def __init__(self, path: str, server: ServerAddress, lost: Callable[[str], object]) -> None:
        self.path = os.path.abspath(path)
        self._lost = lost
        self._connection = self._connect(server)
        self._memory: mmap.mmap | None = None
        opened: Opened = self._ask("open", self.path)
        self.inputs, self.optional, self.outputs, self.metadata = opened

    def run(self, inputs: dict[str, Any], names: list[str]) -> list[Any]:
        """The outputs of these names.

        Raises:
            RosVisualiseError: the network fails on this input, or the server is lost.
        """
        arrays = {name: np.ascontiguousarray(one) for name, one in inputs.items()}
        places, size = {}, 0
        for name, one in arrays.items():
            places[name] = SharedArray(size, one.dtype.str, one.shape)
            size += -(-one.nbytes // _ALIGNMENT) * _ALIGNMENT
        if self._memory is None or len(self._memory) < size:
            self._share(size)
        assert self._memory is not None
        for name, place in places.items():
            place.of(self._memory)[...] = arrays[name]
        found: list[Any] = self._ask("run", places, names)
        return found

    def _share(self, size: int) -> None:
        """Share memory of this size with the server; it ends with the last of both."""
        with tempfile.TemporaryFile(dir=_folder()) as file:
            os.posix_fallocate(file.fileno(), 0, size)
            memory = mmap.mmap(file.fileno(), size)
            self._ask("share", size, handle=file.fileno())
        self._memory = memory

    def _ask(self, *request: Any, handle: int | None = None) -> Any:
        try:
            self._connection.send(request)
            if handle is not None:
                send_handle(self._connection, handle, None)
                os.set_blocking(self._connection.fileno(), True)  # it takes rospy's timeout
            answer = self._connection.recv()
        except (OSError, EOFError):
            self._fail("the process that runs the networks has ended")
        if isinstance(answer, RosVisualiseError):
            raise answer
        return answer

    def _connect(self, server: ServerAddress) -> Connection:
        """A connection, also to a server that is just being started."""
        end_s = time.monotonic() + _PATIENCE_S
        while True:
            try:
                return Client(server.path, "AF_UNIX", server.key)
            except (OSError, EOFError):
                if time.monotonic() > end_s:
                    self._fail("cannot connect to the process that runs the networks")
                time.sleep(_AGAIN_S)

    def _fail(self, reason: str) -> NoReturn:
        self._lost(reason)
        raise OpenError(reason)


def _folder() -> str | None:
    """A folder in memory, where the system has one."""
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
