"""Tasks on this machine: as many processes at once as there are workers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Any

from ros_visualise.batch.apart import Limits, TaskFailure, apart
from ros_visualise.batch.task import Task

TRIES = 3
_AHEAD = 2  # tasks of each worker that wait

Outcome = tuple[Task, Any]


def run_here(
    work: Callable[[Task], Any],
    tasks: Iterable[Task],
    limits: Limits,
    workers: int,
    stopped: Callable[[], bool],
) -> Iterator[Outcome]:
    """Do the work of each task in a process of its own; each with its result or `TaskFailure`.

    Raises:
        Stopped: ``stopped`` returned True.
    """
    with ThreadPoolExecutor(workers) as pool:
        pending: set[Future[Outcome]] = set()
        for task in tasks:
            pending.add(pool.submit(_try, work, task, limits, stopped))
            if len(pending) >= _AHEAD * workers:
                done, pending = wait(pending, return_when=FIRST_COMPLETED)
                yield from (one.result() for one in done)
        while pending:
            done, pending = wait(pending, return_when=FIRST_COMPLETED)
            yield from (one.result() for one in done)


def _try(
    work: Callable[[Task], Any], task: Task, limits: Limits, stopped: Callable[[], bool]
) -> Outcome:
    for number in range(1, TRIES + 1):
        result = apart(work, task, limits, stopped)
        if not isinstance(result, TaskFailure):
            break
        result = result._replace(attempts=number)
        if not result.may_pass:
            break
    return task, result
