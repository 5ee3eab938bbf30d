"""Work in a process of its own, with limits of time and memory."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import tempfile
import time
from collections.abc import Callable
from functools import cache
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from typing import Any, NamedTuple, NoReturn

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError, UsageError
from ros_visualise.core.limits import set_frames_at_once, set_max_memory
from ros_visualise.core.printing import sized
from ros_visualise.core.regular_files import read_file

_LOOK_S = 0.1
_LONGEST_FOLDER = 70  # a socket's address in it has 32 more letters, and at most 107
# A Dask worker has it, for long lives; with it the memory of each image is given back and asked for
# again, which takes a sixth more time. A process here lives for one task.
_TRIM = "MALLOC_TRIM_THRESHOLD_"
_OF_TERMINAL = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_AGAIN = ("crash", "timeout", "memory")
_sender: Connection | None = None


class Limits(NamedTuple):
    """Seconds and bytes that one piece of work may take."""

    timeout_s: float
    memory: int


class TaskFailure(NamedTuple):
    """Failed work: its kind, a line about it, and how often it was tried.

    Kinds: ``open`` and ``error`` (the work says why), ``crash``, ``timeout`` and ``memory``.
    """

    kind: str
    reason: str
    attempts: int = 1

    @property
    def may_pass(self) -> bool:
        """True if trying again may help."""
        return self.kind in _AGAIN


class Stopped(Exception):
    """A person stopped the batch."""


def apart(
    work: Callable[[Any], Any],
    task: Any,
    limits: Limits,
    stopped: Callable[[], bool] = lambda: False,
) -> Any:
    """The result of ``work(task)``, called in a process of its own, or its `TaskFailure`.

    The process ends with this one, and is killed when it takes too long.

    Raises:
        Stopped: ``stopped`` returned True.
    """
    receiver, sender = context().Pipe(duplex=False)
    process = context().Process(target=_call, args=(work, task, limits, sender))  # type: ignore[attr-defined]
    with receiver:
        process.start()
        sender.close()
        end_s = time.monotonic() + limits.timeout_s
        try:
            while not wait([receiver, process.sentinel], _LOOK_S):
                if stopped():
                    raise Stopped
                if memory_of(process.pid) > limits.memory:
                    return TaskFailure(
                        "memory",
                        f"needed more than {sized(limits.memory)} of memory; raise --max-memory",
                    )
                if time.monotonic() > end_s:
                    return TaskFailure(
                        "timeout", f"not finished after {limits.timeout_s:g} s; raise --timeout"
                    )
            return receiver.recv()
        except EOFError:  # it ended without a word
            process.join()
            return _crashed(process.exitcode)
        finally:
            process.kill()
            process.join()


def _crashed(status: int | None) -> TaskFailure:
    if status is not None and status < 0:
        return TaskFailure("crash", f"killed by {signal.Signals(-status).name}")
    return TaskFailure("crash", f"ended with exit status {status}")


@cache
def context() -> BaseContext:
    """Processes that are forked from one that has imported everything and runs no threads."""
    # that of a Dask worker is a daemon, which may have no children: they end with it all the same
    multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
    has_room = len(os.fsencode(tempfile.gettempdir())) <= _LONGEST_FOLDER
    if "forkserver" not in multiprocessing.get_all_start_methods() or not has_room:
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["ros_visualise.batch.preload"])
    # signals of the terminal are for this process, which ends the others
    resource_tracker.ensure_running()  # it would allow them again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _OF_TERMINAL)
    trim = os.environ.pop(_TRIM, None)
    forkserver.ensure_running()
    if trim is not None:
        os.environ[_TRIM] = trim
    signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return context


def _call(work: Callable[[Any], Any], task: Any, limits: Limits, sender: Connection) -> None:
    """Call the work in the new process, and send its result or its failure."""
    global _sender
    _sender = sender
    logging.getLogger("ros_visualise").addHandler(logging.NullHandler())
    logging.getLogger("ros_visualise").propagate = False  # the batch reports errors
    supervision.start("parent", end_with_parent)
    set_max_memory(limits.memory)
    set_frames_at_once(1)  # with more, a damaged film may have other images each time
    try:
        result = work(task)
    except RosVisualiseError as error:
        result = TaskFailure("open" if isinstance(error, UsageError) else "error", str(error))
    except BaseException as error:
        result = TaskFailure("error", f"{type(error).__name__}: {error}")
    sender.send(result)
    os._exit(0)  # nothing that is left may hinder the end


def give_up(failure: TaskFailure) -> NoReturn:
    """End the work of this process with a failure, from any thread."""
    assert _sender is not None
    _sender.send(failure)
    os._exit(0)


def end_with_parent(last: Callable[[], object] = lambda: None) -> None:
    """End this process when the one that started it ends; ``last`` is called before."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    last()
    os._exit(1)


def memory_of(pid: int | None) -> int:
    """Bytes of memory of a process; 0 where the system does not say."""
    try:
        return int(read_file(f"/proc/{pid}/statm").split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0
