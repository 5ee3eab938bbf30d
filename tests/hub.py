"""A middleware for tests: a graph of nodes in one process, whose messages travel as CDR.

It has all that `ros_visualise.runtime.middleware.Middleware` asks for, and nothing of any ROS.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from hub_ends import Offered, ParametersClient, Publisher, Subscriber, Topic

from ros_visualise.core.errors import OpenError, RosVisualiseError
from ros_visualise.core.params import Parameters, specs
from ros_visualise.core.rate import Clock, WallClock
from ros_visualise.data import CameraInfo
from ros_visualise.messages.recorded import TopicType
from ros_visualise.running.executables.by_name import run
from ros_visualise.runtime.middleware import Listing, Managed, ParametersListener

PATIENCE_S = 20.0


class Hub:
    """What holds a graph together."""

    def __init__(self) -> None:
        self.topics: dict[str, Topic] = {}
        self.services: dict[str, Callable[[], str | None]] = {}
        self.managed: dict[str, Managed] = {}
        self.parameters: dict[str, tuple[str, Parameters[Any]]] = {}  # by name: of which node
        self.lock = threading.RLock()

    def topic(self, name: str, type_name: str) -> Topic:
        """The topic of that name, which is there from now on."""
        return self.topics.setdefault(name, Topic(type_name))

    @contextmanager
    def running(
        self, name: str, *args: str, ends_with: int = 0, **given: Any
    ) -> Iterator[HubMiddleware]:
        """One of our executables as a node of this graph, until the end of the block.

        Args:
            name: of the executable, and of the node.
            args: what else stands on its command line.
            ends_with: its exit status.
            given: its private parameters, with ``__`` where those have a ``/``.
        """
        told = {key.replace("__", "/"): value for key, value in given.items()}
        middleware = HubMiddleware(self, told, args=args)
        statuses: list[object] = []
        thread = threading.Thread(target=run_one, args=(name, middleware, statuses), name=name)
        thread.start()
        try:
            yield middleware
        finally:
            middleware.end("the test is over")
            thread.join(PATIENCE_S)
        assert statuses == [ends_with], f"{name} did not end well"


def run_one(name: str, middleware: HubMiddleware, statuses: list[object]) -> None:
    """Run one of our executables to its end; its exit status goes to the others."""
    try:
        run(name, middleware)
    except SystemExit as end:
        statuses.append(end.code)


class HubMiddleware:
    """One node of a hub's graph.

    Args:
        hub: what it is a node of.
        given: its private parameters.
        name: of the node, which `begin` gives as well.
        args: what else stands on its command line.
    """

    def __init__(
        self,
        hub: Hub,
        given: Mapping[str, Any] | None = None,
        name: str = "",
        args: Sequence[str] = (),
    ) -> None:
        self.name = f"/{name}"
        self._hub = hub
        self._given = dict(given or {})
        self._args = list(args)
        self._over = threading.Event()

    flag = "{}={}"

    def begin(self, name: str) -> None:
        self.name = f"/{name}"

    def end(self, reason: str) -> None:
        self._over.set()
        with self._hub.lock:
            for topic in self._hub.topics.values():
                topic.publishers = [node for node in topic.publishers if node != self.name]
                topic.latched.pop(self.name, None)

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
            raise OpenError(f"{url}: there are no packages here")
        return url

    def resolve(self, name: str) -> str:
        if name.startswith("~"):
            return f"{self.name}/{name[1:]}".rstrip("/")
        return name if name.startswith("/") else f"/{name}"

    def advertise(self, topic: str, type: TopicType) -> Publisher:
        return Publisher(self._hub, self.name, self.resolve(topic), type)

    def subscribe(
        self, topic: str, kind: type, take: Callable[[Any], None], refuse: Callable[[str], None]
    ) -> Subscriber:
        return Subscriber(self._hub, self.name, self.resolve(topic), kind, take, refuse)

    def offer(self, service: str, act: Callable[[], str | None]) -> Offered:
        return Offered(self._hub.services, self.resolve(service), act)

    def offer_calibration(self, service: str, take: Callable[[CameraInfo], None]) -> Offered:
        return Offered(self._hub.services, self.resolve(service), take)

    def manage(self, managed: Managed) -> Offered:
        return Offered(self._hub.managed, self.name, managed)

    def call(self, service: str) -> None:
        act = self._hub.services.get(service)
        if act is None:
            raise RosVisualiseError(f"{service}: nobody offers it")
        act()

    def serve_parameters(self, parameters: Parameters[Any], namespace: str) -> Offered:
        name = self.resolve(f"~{namespace}")
        return Offered(self._hub.parameters, name, (self.name, parameters))

    def follow_parameters(self, node: str, listener: ParametersListener) -> ParametersClient:
        return ParametersClient(self._hub, node, listener)

    def look(self) -> Listing:
        with self._hub.lock:
            topics = self._hub.topics.items()
            places = {
                node: [name for name, (of, _) in self._hub.parameters.items() if of == node]
                for node, _ in self._hub.parameters.values()
            }
            return Listing(
                [(name, tuple(of.publishers)) for name, of in topics],
                [(name, [one.node for one in of.subscribers]) for name, of in topics],
                {name: of.type_name for name, of in topics},
                places,
                (),
            )

    def clock(self) -> Clock:
        return WallClock()

    def publish_clock(self, now_ns: Callable[[], int]) -> Offered:
        return Offered({}, "/clock", now_ns)
