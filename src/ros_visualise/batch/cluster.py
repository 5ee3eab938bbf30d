"""Tasks on other machines, by Dask: it distributes them, and tries again when a worker is lost."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from itertools import islice
from typing import Any

from ros_visualise.batch.apart import Limits, Stopped, TaskFailure, apart
from ros_visualise.batch.local import TRIES, Outcome
from ros_visualise.batch.task import Task
from ros_visualise.core.errors import OpenError, RosVisualiseError, UsageError

LOCAL = "local"
"""The address of a cluster that is started on this machine."""

_AHEAD = 4  # tasks of each worker that wait
_PATIENCE_S = 20
_LOOK_S = 0.2
SHARED = "inputs and --out must be on a disk that all machines share"


class FailedTask(Exception):
    """A task failed in a way that may pass: Dask tries it again."""


def run_on_cluster(
    address: str,
    work: Callable[[Task], Any],
    tasks: Iterable[Task],
    limits: Limits,
    workers: int,
    stopped: Callable[[], bool],
) -> Iterator[Outcome]:
    """Do the work of each task on a cluster; each with its result or failure.

    Args:
        address: of its scheduler, or `LOCAL`.
        work, tasks, limits, stopped: as of `ros_visualise.batch.local.run_here`.
        workers: of a local cluster.

    Raises:
        OpenError: no scheduler answers.
        Stopped: ``stopped`` returned True.
    """
    with ExitStack() as undo:
        client = _connected(address, workers, undo)
        from distributed import wait

        waiting, sent = iter(tasks), dict[Any, Task]()
        while True:
            slots = max(1, sum(client.nthreads().values()))
            for task in islice(waiting, max(0, _AHEAD * slots - len(sent))):
                again = {"key": f"{task.key}-{os.getpid()}", "retries": TRIES - 1}
                sent[client.submit(attempt, work, task, limits, **again)] = task
            if not sent:
                return
            if stopped():
                raise Stopped
            with suppress(asyncio.TimeoutError):
                for future in wait([*sent], _LOOK_S, "FIRST_COMPLETED").done:
                    yield sent.pop(future), _outcome(future)


def _connected(address: str, workers: int, undo: ExitStack) -> Any:
    """A client of the cluster, and a cluster of so many workers if it is `LOCAL`."""
    try:
        import dask.config

        dask.config.set({"logging": {"distributed": "critical"}})  # failures are rows
        from distributed import Client, LocalCluster
    except ImportError:
        raise UsageError(
            "--cluster needs Dask; install it: pip install 'ros_visualise[cluster]' (in a clone:"
            " pip install '.[cluster]')"
        ) from None
    if address == LOCAL:
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address=None,
            silence_logs=logging.CRITICAL,
        )
        address = undo.enter_context(cluster).scheduler_address
    try:
        return undo.enter_context(Client(address, timeout=_PATIENCE_S))
    except (OSError, ValueError) as error:
        raise OpenError(f"--cluster {address}: no scheduler answers ({error})") from None


def attempt(work: Callable[[Task], Any], task: Task, limits: Limits) -> Any:
    """The result of a task on this worker, in a process of its own, or its failure.

    Raises:
        FailedTask: it may work if it is tried again.
    """
    for path in (task.path, task.folder):
        if not os.path.exists(path):
            machine = socket.gethostname()
            return TaskFailure("open", f"{path}: not found on {machine}; {SHARED}")
    result = apart(work, task, limits)
    if isinstance(result, TaskFailure) and result.may_pass:
        raise FailedTask(*result[:2])
    return result


def _outcome(future: Any) -> Any:
    if future.status in ("cancelled", "lost"):
        raise RosVisualiseError(
            "lost the cluster's scheduler; run the same command again to continue"
        )
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, FailedTask):
        kind, reason = error.args
        return TaskFailure(kind, reason, TRIES)
    if type(error).__name__ == "KilledWorker":
        return TaskFailure("crash", "the cluster lost its workers", TRIES)
    return TaskFailure("error", f"{type(error).__name__}: {error}")
