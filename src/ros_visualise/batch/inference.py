"""Networks of a batch's tasks on GPUs: a process for each GPU, which gathers images of all tasks.

A process that ends or hangs is started again. The tasks that were waiting for it fail in a way that
may pass, and are tried again.
"""

from __future__ import annotations

import logging
import os
import shutil
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from multiprocessing.connection import Client, Connection
from pathlib import Path
from typing import Any

from ros_visualise.batch.apart import TaskFailure, context, end_with_parent, give_up
from ros_visualise.batch.task import Task
from ros_visualise.core import supervision
from ros_visualise.core.errors import OpenError, RosVisualiseError
from ros_visualise.core.limits import set_max_memory
from ros_visualise.landmarks.networks import remote
from ros_visualise.landmarks.networks.gpus import gpus
from ros_visualise.landmarks.networks.remote import ServerAddress
from ros_visualise.landmarks.networks.serving import NetworkServer
from ros_visualise.landmarks.networks.session import OnnxSession, Provider, is_available
from ros_visualise.nodes.landmark_detector import OWN_MODEL

_PROVIDER = Provider.CUDA
_LOOK_S = 1.0
_HANG_S = 60.0  # longer than a batch, and than it takes to open a network
_START_S = 60.0
_KEY_BYTES = 32


@contextmanager
def network_servers(
    device: str, memory: int, say: Callable[[str], None]
) -> Iterator[tuple[ServerAddress, ...]]:
    """The servers of this machine's GPUs; none if the device is the CPU or no GPU can be used.

    Args:
        device: as the option of this name.
        memory: as of `ros_visualise.batch.apart.Limits`, for each server.
        say: called with the reason if no GPU can be used.
    """
    if device == Provider.CPU.value:
        yield ()
        return
    with ExitStack() as undo:
        folder = undo.enter_context(tempfile.TemporaryDirectory(prefix="networks-"))
        try:
            if not is_available(_PROVIDER):
                raise OpenError("no GPU, or no onnxruntime-gpu")
            started = [
                undo.enter_context(
                    _GpuServer(Path(folder) / str(number), _PROVIDER, number, memory)
                )
                for number in range(max(1, gpus()))
            ]
        except OpenError as error:
            say(f"--device {device}: {error}; networks run on the CPU")
            started = []
        yield tuple(one.address for one in started)


def run_served(work: Callable[[Task], Any], servers: Sequence[ServerAddress], task: Task) -> Any:
    """Do the work of a task, whose networks run in one of the servers."""
    server = servers[int(task.key, 16) % len(servers)]
    remote.use(server, lambda reason: give_up(TaskFailure("crash", reason)))
    return work(task)


class _GpuServer:
    """A server in a process that is watched; it ends with the context.

    Raises:
        OpenError: it cannot run networks.
    """

    def __init__(self, path: Path, provider: Provider, gpu: int, memory: int) -> None:
        self.address = ServerAddress(str(path), os.urandom(_KEY_BYTES))
        self._how = provider, gpu, memory
        self._is_over = threading.Event()
        self._starting = threading.Lock()
        self._connection = self._start()
        self._watching = supervision.start(f"networks {gpu}", self._watch)

    def __enter__(self) -> _GpuServer:
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        with self._starting:
            self._process.kill()  # which ends a ping, too
        self._watching.join()
        self._stop()

    def _start(self) -> Connection:
        """Start the process; a connection to it."""
        receiver, sender = context().Pipe(duplex=False)
        arguments = (self.address, *self._how, sender)
        with self._starting:
            if self._is_over.is_set():
                raise OpenError("stopped")
            self._process = context().Process(target=_serve, args=arguments)  # type: ignore[attr-defined]
            self._process.start()
        sender.close()
        with receiver:
            said = "its process ended"
            with suppress(EOFError):
                said = (
                    receiver.recv()
                    if receiver.poll(_START_S)
                    else f"no answer within {_START_S:g} s"
                )
        if said:
            self._stop()
            raise OpenError(said)
        return Client(self.address.path, "AF_UNIX", self.address.key)

    def _watch(self) -> None:
        while not self._is_over.wait(_LOOK_S):
            if not self._answers():
                self._stop()
                with suppress(OpenError, OSError, EOFError):  # tried again at the next look
                    self._connection = self._start()

    def _answers(self) -> bool:
        try:
            self._connection.send(("ping",))
            return self._connection.poll(_HANG_S) and bool(self._connection.recv())
        except (OSError, EOFError):
            return False

    def _stop(self) -> None:
        self._process.kill()
        self._process.join()


def _serve(
    address: ServerAddress, provider: Provider, gpu: int, memory: int, ready: Connection
) -> None:
    """The process of a server; it says nothing when it is ready, else why it cannot work."""
    logging.getLogger("ros_visualise").addHandler(logging.NullHandler())
    logging.getLogger("ros_visualise").propagate = False
    folder = Path(address.path).parent  # which a killed batch leaves
    removed = partial(shutil.rmtree, folder, ignore_errors=True)
    supervision.start("parent", partial(end_with_parent, removed))
    set_max_memory(memory)
    threads = len(os.sched_getaffinity(0))
    try:
        if OWN_MODEL.is_file():
            OnnxSession(str(OWN_MODEL), provider, threads, gpu)
        server = NetworkServer(address, provider, threads, gpu)
    except RosVisualiseError as error:
        ready.send(str(error))
        os._exit(1)
    ready.send("")
    server.serve()
