"""A middleware for tests: a graph of nodes in one process, whose messages travel as CDR.

It has all that `ros_visualise.runtime.middleware.Middleware` asks for, and nothing of any ROS.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from ros_visualise.data import CameraInfo
from ros_visualise.errors import DamagedMessage, OpenError, ParameterError, RosVisualiseError
from ros_visualise.executables.by_name import run
from ros_visualise.messages import from_message, type_name
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import TopicType
from ros_visualise.params import Parameters, Value, specs
from ros_visualise.rate import Clock, WallClock
from ros_visualise.runtime.middleware import Listing, ParametersListener
from ros_visualise.runtime.playing import offered
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.sinks.encoding import Encoder

TYPES = Definitions("cdr")
PATIENCE_S = 20.0


@dataclass
class Topic:
    """What all nodes share of a topic."""

    type_name: str
    publishers: list[str] = field(default_factory=list)
    subscribers: list[Subscriber] = field(default_factory=list)
    latched: dict[str, bytes] = field(default_factory=dict)  # node -> its last message


class Hub:
    """What holds a graph together."""

    def __init__(self) -> None:
        self.topics: dict[str, Topic] = {}
        self.services: dict[str, Callable[[], str | None]] = {}
        self.parameters: dict[str, tuple[str, Parameters[Any]]] = {}  # by name: of which node
        self.lock = threading.RLock()

    def topic(self, name: str, type_name: str) -> Topic:
        """The topic of that name, which is there from now on."""
        return self.topics.setdefault(name, Topic(type_name))

    @contextmanager
    def running(self, name: str, *args: str, **given: Any) -> Iterator[HubMiddleware]:
        """One of our executables as a node of this graph, until the end of the block.

        Args:
            name: of the executable, and of the node.
            args: what else stands on its command line.
            given: its private parameters, with ``__`` where those have a ``/``.
        """
        told = {key.replace("__", "/"): value for key, value in given.items()}
        middleware = HubMiddleware(self, told, args=args)
        statuses: list[object] = []
        thread = threading.Thread(target=_run, args=(name, middleware, statuses), name=name)
        thread.start()
        yield middleware
        middleware.end("the test is over")
        thread.join(PATIENCE_S)
        assert statuses == [0], f"{name} did not end well"


def _run(name: str, middleware: HubMiddleware, statuses: list[object]) -> None:
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


class Offered:
    """Something that stands in a table until it is closed."""

    def __init__(self, table: dict[str, Any], name: str, what: Any) -> None:
        self._table, self._name = table, name
        table[name] = what

    def close(self) -> None:
        self._table.pop(self._name, None)


class Publisher:
    """One node's publisher of a topic."""

    def __init__(self, hub: Hub, node: str, name: str, type: TopicType) -> None:
        self.name = name
        self._hub, self._node = hub, node
        self._encoder = Encoder("cdr")
        declared = self._encoder.declare(type)
        self._latched = type.qos.transient_local
        with hub.lock:
            self._topic = hub.topic(name, declared.name)
            self._topic.publishers.append(node)

    @property
    def connections(self) -> int:
        return len(self._topic.subscribers)

    @property
    def dropped(self) -> int:
        return sum(one.inbox.dropped for one in self._topic.subscribers)

    def publish(self, message: Any) -> None:
        data = bytes(self._encoder.encode(message))
        with self._hub.lock:
            if self._latched:
                self._topic.latched[self._node] = data
            for one in self._topic.subscribers:
                one.inbox.put(Packet(0, data, time.monotonic_ns()))

    def flush(self, timeout_s: float) -> None:
        for one in tuple(self._topic.subscribers):
            one.inbox.wait_until_taken(timeout_s)

    def wait_for_room(self, timeout_s: float) -> None:
        self.flush(timeout_s)

    def close(self) -> None:
        with self._hub.lock:
            self._topic.publishers.remove(self._node)


class Subscriber:
    """One node's subscription: the newest messages, on a thread of its own."""

    def __init__(
        self,
        hub: Hub,
        node: str,
        name: str,
        kind: type,
        take: Callable[[Any], None],
        refuse: Callable[[str], None],
    ) -> None:
        self.node = node
        self.inbox = Inbox(lossless=False, keep=8)
        self._hub, self._kind, self._take, self._refuse = hub, kind, take, refuse
        with hub.lock:
            self._topic = hub.topic(name, type_name(kind))
            self._topic.subscribers.append(self)
            for data in self._topic.latched.values():
                self.inbox.put(Packet(0, data, time.monotonic_ns()))
        threading.Thread(target=self._run, name=f"{node} {name}", daemon=True).start()

    def close(self) -> None:
        with self._hub.lock:
            self._topic.subscribers = [one for one in self._topic.subscribers if one is not self]
        self.inbox.close(discard=True)

    def _run(self) -> None:
        while (packet := self.inbox.take()) is not None:
            try:
                read = TYPES.read(type_name(self._kind), packet.message)
                message: Any = from_message(read, self._kind)
            except (DamagedMessage, ValueError) as error:
                self._refuse(str(error))
            else:
                self._take(message)


class ParametersClient:
    """Parameters elsewhere in the process, looked up until they are there."""

    def __init__(self, hub: Hub, name: str, listener: ParametersListener) -> None:
        self._hub, self._name, self._listener = hub, name, listener
        self._closed = threading.Event()
        self._known: Parameters[Any] | None = None
        self._forget: Callable[[], None] = lambda: None
        threading.Thread(target=self._follow, name=f"parameters of {name}", daemon=True).start()

    @property
    def is_there(self) -> bool:
        return self._name in self._hub.parameters

    def set(self, values: Mapping[str, Any]) -> Mapping[str, Any]:
        if not self.is_there:
            raise ConnectionError(f"{self._name} has gone")
        _, parameters = self._hub.parameters[self._name]
        try:
            return vars(parameters.update(values))
        except ParameterError as error:
            raise ParameterError(str(error)) from error

    def close(self) -> None:
        self._closed.set()
        self._forget()

    def _follow(self) -> None:
        while not self._closed.wait(0.02):
            _, parameters = self._hub.parameters.get(self._name, ("", None))
            if parameters is not None and parameters is not self._known:
                self._known = parameters
                self._forget = parameters.on_change(self._changed)
                kind = type(parameters.current)
                self._listener.declared(kind, _our_own(kind))
                self._changed(parameters.current, {})

    def _changed(self, current: Any, _: Mapping[str, Value]) -> None:
        self._listener.told(vars(current))


def _our_own(params: type) -> Any:
    names = [spec.name for spec in specs(params)]
    found = (node for kind, node in offered() if [spec.name for spec in specs(kind)] == names)
    return next(found, None)
