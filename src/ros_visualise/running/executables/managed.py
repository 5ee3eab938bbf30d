"""A graph whose states a lifecycle manager of ROS 2 sets."""

from __future__ import annotations

import gc
import logging
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import AbstractContextManager, ExitStack, closing
from functools import partial
from queue import Empty, SimpleQueue

from ros_visualise.core.errors import Unreachable
from ros_visualise.graph import Graph
from ros_visualise.running.executables.execution import Run, announce_time, publish_time, running
from ros_visualise.runtime.middleware import Host, Transport

log = logging.getLogger(__name__)

_SPIN_S = 0.1
_ENDS = "this node is shutting down"


def run_managed(
    host: Host, transport: Transport, graph: Graph, namespaces: Mapping[str, str]
) -> int:
    """Run a graph as its manager asks, until this process has to end; the exit status.

    Args:
        host, transport, graph, namespaces: as of `execution.run_graph`.

    Raises:
        UsageError: the middleware has no managed nodes.
    """
    if graph.makes_time:
        announce_time(host, transport)
    surround = (), publish_time
    where = host, transport, graph, namespaces
    opening = partial(running, *where, *surround, stays=True, active=False)
    managed = ManagedGraph(opening)
    with closing(host.manage(managed)), closing(managed):
        log.info("unconfigured: waiting for a lifecycle manager")
        while not (host.is_over() or managed.is_over):
            managed.follow(_SPIN_S)
    return int(managed.failed)


class ManagedGraph:
    """A graph as `ros_visualise.runtime.middleware.Managed`; the thread of `follow` does the work.

    Args:
        running: opens the graph.

    Attributes:
        failed: data was lost since the start.
    """

    def __init__(self, running: Callable[[], AbstractContextManager[Run]]) -> None:
        self.failed = False
        self._running = running
        self._open = ExitStack()
        self._run: Run | None = None
        self._has_remains = False
        self._asked: SimpleQueue[tuple[Callable[[], None], Future[None]]] = SimpleQueue()
        self._asking = threading.Lock()
        self._is_closed = False

    @property
    def is_over(self) -> bool:
        """True if the configured graph has ended."""
        return self._run is not None and self._run.is_over

    def configure(self) -> None:
        """Open the graph."""
        self._ask(self._configure)

    def activate(self) -> None:
        """Process and publish messages."""
        self._ask(lambda: self._configured.process.activate())

    def deactivate(self) -> None:
        """Stop processing and publishing messages."""
        self._ask(lambda: self._configured.process.deactivate())

    def cleanup(self) -> None:
        """Close the graph, if it is open."""
        self._ask(self._cleanup)

    def follow(self, timeout_s: float) -> None:
        """Serve a request, and spin the graph."""
        is_at_rest = not self._do_next(0 if self._run else timeout_s)
        if self._run is not None:
            self._run.spin(timeout_s)
        elif is_at_rest and self._has_remains:  # its threads have ended meanwhile
            gc.collect()  # files and decoders go with the last reference to them
            self._has_remains = False

    def close(self) -> None:
        """Close the graph, and reject further requests."""
        with self._asking:
            self._is_closed = True
        while self._do_next(0):
            pass
        self._cleanup()

    @property
    def _configured(self) -> Run:
        if self._run is None:
            raise Unreachable("not configured")
        return self._run

    def _ask(self, work: Callable[[], None]) -> None:
        """Let the thread of `follow` do something, and wait for it."""
        done: Future[None] = Future()
        with self._asking:
            if self._is_closed:
                raise Unreachable(_ENDS)
            self._asked.put((work, done))
        done.result()

    def _do_next(self, timeout_s: float) -> bool:
        """Serve the next request, if any within this time."""
        try:
            work, done = self._asked.get(timeout=timeout_s)
        except Empty:
            return False
        try:
            if self._is_closed:
                raise Unreachable(_ENDS)
            done.set_result(work())
        except KeyboardInterrupt:  # asked to end while it was opening something
            done.set_exception(Unreachable(_ENDS))
            raise
        except Exception as error:
            done.set_exception(error)
        return True

    def _configure(self) -> None:
        self._run = self._open.enter_context(self._running())

    def _cleanup(self) -> None:
        run, self._run = self._run, None
        self._open.close()
        if run is not None:
            run.process.leave()
            self.failed |= run.process.failed
            self._has_remains = True
