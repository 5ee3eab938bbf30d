"""A transport for tests: a graph of nodes in one process, whose messages travel as CDR.

It has all that `ros_visualise.runtime.middleware.Transport` asks for, and nothing of any ROS.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import partial
from typing import Any

from hosts import Entry, GivenHost, running
from hub_ends import ParametersClient, Publisher, Subscriber, Topic

from ros_visualise.core.errors import RosVisualiseError, Unreachable
from ros_visualise.core.params import Parameters
from ros_visualise.core.rate import Clock, WallClock
from ros_visualise.data import CameraInfo
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.bridge.services import answer
from ros_visualise.runtime.middleware import Listing, Managed, ParametersListener


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

    def host(self, given: Mapping[str, Any] | None = None, args: Sequence[str] = ()) -> GivenHost:
        """A process on this graph, with its options and what else stands on its command line."""
        return GivenHost(partial(HubTransport, self), given, args, self.managed)

    def running(
        self, name: str, *args: str, ends_with: int = 0, **given: Any
    ) -> AbstractContextManager[GivenHost]:
        """One of our executables as a node of this graph, until the end of the block.

        Args:
            name: of the executable, and of the node.
            args: what else stands on its command line.
            ends_with: its exit status.
            given: its private parameters, with ``__`` where those have a ``/``.
        """
        told = {key.replace("__", "/"): value for key, value in given.items()}
        return running(name, self.host(told, args), ends_with)


class HubTransport:
    """One node of a hub's graph.

    Args:
        hub: what it is a node of.
        name: of the node.
    """

    def __init__(self, hub: Hub, name: str = "") -> None:
        self.name = f"/{name}"
        self._hub = hub

    def close(self) -> None:
        with self._hub.lock:
            for topic in self._hub.topics.values():
                topic.publishers = [node for node in topic.publishers if node != self.name]
                topic.latched.pop(self.name, None)

    def resolve(self, name: str) -> str:
        if name.startswith("~"):
            return f"{self.name}/{name[1:]}".rstrip("/")
        return name if name.startswith("/") else f"/{name}"

    def advertise(self, topic: str, type: TopicType) -> Publisher:
        return Publisher(self._hub, self.name, self.resolve(topic), type)

    def subscribe(
        self, topic: str, kind: type, take: Callable[[Any], None], reject: Callable[[str], None]
    ) -> Subscriber:
        return Subscriber(self._hub, self.name, self.resolve(topic), kind, take, reject)

    def offer(self, action: str, act: Callable[[], str | None]) -> Entry:
        return Entry(self._hub.services, self.resolve(action), act)

    def offer_calibration(self, service: str, take: Callable[[CameraInfo], None]) -> Entry:
        return Entry(self._hub.services, self.resolve(service), take)

    def call(self, action: str) -> None:
        act = self._hub.services.get(action)
        if act is None:
            raise Unreachable(f"{action}: not offered")
        done, text = answer(act)
        if not done:
            raise RosVisualiseError(f"{action}: {text}")

    def serve_parameters(self, parameters: Parameters[Any], namespace: str) -> Entry:
        name = self.resolve(f"~{namespace}")
        return Entry(self._hub.parameters, name, (self.name, parameters))

    def follow_parameters(self, node: str, listener: ParametersListener) -> ParametersClient:
        return ParametersClient(self._hub, node, listener)

    def listing(self) -> Listing:
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
