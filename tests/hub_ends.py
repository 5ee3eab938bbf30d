"""What a node of `hub.Hub` has there: publishers, subscriptions, parameters."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

from ros_visualise.core.errors import DamagedMessage, ParameterError, Unreachable
from ros_visualise.core.params import Parameters, Value, specs
from ros_visualise.core.supervision import attempt
from ros_visualise.messages import from_message
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.middleware import ParametersListener
from ros_visualise.runtime.playing import offered
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.sinks.encoding import Encoder

if TYPE_CHECKING:
    from hub import Hub

TYPES = Definitions("cdr")


@dataclass
class Topic:
    """What all nodes share of a topic."""

    type_name: str
    publishers: list[str] = field(default_factory=list)
    subscribers: list[Subscriber] = field(default_factory=list)
    latched: dict[str, bytes] = field(default_factory=dict)  # node -> its last message


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
            if self._node in self._topic.publishers:
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
            self._topic = hub.topic(name, kind.type_name)
            self._topic.subscribers.append(self)
            for data in self._topic.latched.values():
                self.inbox.put(Packet(0, data, time.monotonic_ns()))
        threading.Thread(target=self._run, name=f"{node} {name}", daemon=True).start()

    @property
    def dropped(self) -> int:
        return self.inbox.dropped

    def close(self) -> None:
        with self._hub.lock:
            self._topic.subscribers = [one for one in self._topic.subscribers if one is not self]
        self.inbox.close(discard=True)

    def _run(self) -> None:
        while (packet := self.inbox.take()) is not None:
            attempt(f"{self.node} {self._topic.type_name}", partial(self._hand_on, packet.message))

    def _hand_on(self, data: bytes) -> None:
        try:
            read = TYPES.read(self._kind.type_name, data)
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
    def connected(self) -> bool:
        return self._name in self._hub.parameters

    def set(self, values: Mapping[str, Any]) -> Mapping[str, Any]:
        if not self.connected:
            raise Unreachable(f"{self._name} has gone")
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
        self._listener.updated(vars(current))


def _our_own(params: type) -> Any:
    names = [spec.name for spec in specs(params)]
    found = (node for kind, node in offered() if [spec.name for spec in specs(kind)] == names)
    return next(found, None)
