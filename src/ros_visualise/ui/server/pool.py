"""Threads for one kind of work, so that no other kind has to wait for it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any, NamedTuple, TypeVar

from ros_visualise.core import supervision

T = TypeVar("T")
_AGAIN_S = 1.0


class _Job(NamedTuple):
    work: Callable[[], Any]
    done: Future[Any]

    def run(self) -> None:
        if not self.done.set_running_or_notify_cancel():
            return
        try:
            self.done.set_result(self.work())
        except supervision.ERRORS as error:
            self.done.set_exception(error)


class Pool:
    """A few threads that work for an event loop, from the first call on."""

    def __init__(self, name: str, threads: int) -> None:
        self._jobs: SimpleQueue[_Job | None] = SimpleQueue()
        self._names = [f"{name} {number}" for number in range(threads)]
        self._is_begun = False

    async def do(self, work: Callable[[], T]) -> T:
        """Call this on one of the threads; returns or raises as it does."""
        if not self._is_begun:
            self._is_begun = True
            for name in self._names:
                supervision.start(name, self._run, _AGAIN_S)
        done: Future[T] = Future()
        self._jobs.put(_Job(work, done))
        return await asyncio.wrap_future(done)

    def close(self) -> None:
        """End each thread after all work that was given before."""
        for _ in self._names:
            self._jobs.put(None)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            job.run()
