"""A host for tests: our executables as threads of this process, over any transport."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from ros_visualise.core.errors import OpenError
from ros_visualise.core.params import specs
from ros_visualise.running.executables.by_name import run
from ros_visualise.runtime.middleware import Handle, Managed, Transport

PATIENCE_S = 20.0


class Entry:
    """Something that stands in a table until it is closed."""

    def __init__(self, table: dict[str, Any], name: str, what: Any) -> None:
        self._table, self._name = table, name
        table[name] = what

    def close(self) -> None:
        self._table.pop(self._name, None)


class GivenHost:
    """A host whose options are given; see `ros_visualise.runtime.middleware.Host`.

    Args:
        join: opens the transport of a node of this name.
        given: the process's options.
        args: what else stands on its command line.
        managed: where nodes stand whose states others drive.
    """

    flag = "{}={}"

    def __init__(
        self,
        join: Callable[[str], Transport],
        given: Mapping[str, Any] | None = None,
        args: Sequence[str] = (),
        managed: dict[str, Managed] | None = None,
    ) -> None:
        self.name = ""
        self._join, self._given, self._args = join, dict(given or {}), list(args)
        self._managed = {} if managed is None else managed
        self._over = threading.Event()
        self._transport: Transport | None = None

    def begin(self, name: str) -> Transport:
        self.name = f"/{name}"
        self._transport = self._join(name)
        return self._transport

    def end(self) -> None:
        self.stop()
        if self._transport is not None:
            self._transport.close()

    def stop(self) -> None:
        """Ask the process to end."""
        self._over.set()

    def is_over(self) -> bool:
        return self._over.is_set()

    def arguments(self) -> list[str]:
        return self._args

    def option(self, name: str, default: Any) -> Any:
        return self._given.get(name, default)

    def starting_values(
        self, params: type, namespace: str = "", known: Iterable[str] = ()
    ) -> dict[str, Any]:
        names = {spec.name: f"{namespace}/{spec.name}".lstrip("/") for spec in specs(params)}
        return {
            spec.name: spec.coerce(self._given[names[spec.name]])
            for spec in specs(params)
            if names[spec.name] in self._given
        }

    def find_file(self, url: str) -> str:
        if url.startswith("package://"):
            raise OpenError(f"{url}: no packages here")
        return url

    def manage(self, managed: Managed) -> Handle:
        return Entry(self._managed, self.name, managed)


class Running:
    """One of our executables on a thread of its own.

    Args:
        name: of the executable.
        host: its options, and the way to its graph.
    """

    def __init__(self, name: str, host: GivenHost) -> None:
        self._name, self._host = name, host
        self._statuses: list[object] = []
        self._thread = threading.Thread(target=self._run, name=name)
        self._thread.start()

    def _run(self) -> None:
        try:
            run(self._name, self._host)
        except SystemExit as end:
            self._statuses.append(end.code)

    def end(self) -> int:
        """Ask it to end; its exit status."""
        self._host.stop()
        self._thread.join(PATIENCE_S)
        assert self._statuses, f"{self._name} did not end"
        [status] = self._statuses
        assert isinstance(status, int)
        return status


@contextmanager
def running(name: str, host: GivenHost, ends_with: int = 0) -> Iterator[GivenHost]:
    """One of our executables until the end of the block, where it has this exit status."""
    node = Running(name, host)
    try:
        yield host
    finally:
        status = node.end()
    assert status == ends_with, f"{name} did not end well"
