"""The live parameters of a node in another process, by the services that every node has."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParametersAtomically,
)
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_parameter_events

from ros_visualise.core.errors import ParameterError, Unreachable
from ros_visualise.runtime.middleware import ParametersListener
from ros_visualise.runtime.ros2.descriptions import Ros2Declaration, declare, our_own, values_of
from ros_visualise.runtime.ros2.errors import translated
from ros_visualise.runtime.ros2.parameters import MEMBERS
from ros_visualise.runtime.ros2.services import result_of
from ros_visualise.runtime.ros2.session import Ros2Session

_NAMES = {
    ListParameters: "list_parameters",
    DescribeParameters: "describe_parameters",
    GetParameters: "get_parameters",
    SetParametersAtomically: "set_parameters_atomically",
}


class ParameterServices:
    """Calls a node's parameter services; each call gives a future with the response.

    Args:
        node: of this process.
        name: full name of the node that has the parameters.
        kinds: the services that are going to be called.
    """

    def __init__(self, node: Node, name: str, kinds: Iterable[Any] = _NAMES) -> None:
        self._node = node
        self._clients = {kind: node.create_client(kind, f"{name}/{_NAMES[kind]}") for kind in kinds}

    @property
    def are_ready(self) -> bool:
        """True if the node offers all of them."""
        return all(client.service_is_ready() for client in self._clients.values())

    def list(self) -> Any:
        """List the names of all parameters."""
        return self._call(ListParameters)

    def describe(self, names: Iterable[str]) -> Any:
        """Describe parameters: type, range, help."""
        return self._call(DescribeParameters, names=list(names))

    def get(self, names: Iterable[str]) -> Any:
        """Get the values of parameters."""
        return self._call(GetParameters, names=list(names))

    def set(self, parameters: Iterable[Parameter]) -> Any:
        """Set all of these parameters or none."""
        messages = [one.to_parameter_msg() for one in parameters]
        return self._call(SetParametersAtomically, parameters=messages)

    def close(self) -> None:
        """Call them no longer."""
        while self._clients:
            self._node.destroy_client(self._clients.popitem()[1])

    def _call(self, kind: Any, **request: Any) -> Any:
        return self._clients[kind].call_async(kind.Request(**request))


_LOOK_S = 0.3
_ANSWER_S = 2.0


class ParameterClient:
    """Follows parameters; see `ros_visualise.runtime.middleware.ParametersClient`.

    Args:
        events: tells of changes.
        node: the full name of the ROS 2 node that has them.
        prefix: what their names begin with.
        listener: receives them.
    """

    def __init__(
        self, events: ParameterEvents, node: str, prefix: str, listener: ParametersListener
    ) -> None:
        self._prefix = prefix
        self._listener = listener
        self._declaration: Ros2Declaration | None = None
        self._values: dict[str, Any] = {}
        self._is_there = False
        self._lock = threading.RLock()
        self._closed = threading.Event()
        self._look = threading.Event()
        self._services = ParameterServices(events.session.node, node)
        self._forget = events.on_change(node, self._changed)
        events.session.start(f"{node} watch", self._follow, again_s=_LOOK_S)

    @property
    def connected(self) -> bool:
        """True while the node is on the graph."""
        return self._is_there

    def set(self, values: Mapping[str, Any]) -> Mapping[str, Any]:
        """Have the node take over all values or none.

        Raises:
            ParameterError: the node refuses.
            Unreachable: it does not answer.
        """
        declaration = self._declaration
        if declaration is None:
            raise Unreachable("its parameters have not been received yet")
        sent = declaration.encode(values)
        asked = [Parameter(name, value=value) for name, value in sent.items()]
        with translated("the node"):
            answer = result_of(self._services.set(asked), _ANSWER_S)
        if answer is None:
            raise Unreachable("no answer")
        if not answer.result.successful:
            raise ParameterError(answer.result.reason or "no reason given")
        with self._lock:
            return declaration.decode({**self._values, **sent})

    def close(self) -> None:
        """Follow them no longer."""
        self._closed.set()
        self._look.set()
        self._forget()

    def _follow(self) -> None:
        our_own()  # takes a while, and is needed soon
        while not self._closed.is_set():
            there = self._services.are_ready
            if there and not self._is_there:
                there = self._meet()
            self._is_there = there
            self._look.wait(_LOOK_S)
            self._look.clear()
        self._services.close()

    def _meet(self) -> bool:
        """Ask a node that is new, or has come back, for its parameters; whether it answers."""
        listed = result_of(self._services.list(), _ANSWER_S)
        names = sorted(listed.result.names) if listed else []
        described = result_of(self._services.describe(names), _ANSWER_S)
        got = result_of(self._services.get(names), _ANSWER_S)
        if listed is None or described is None or got is None:
            return False
        with self._lock:
            self._values = values_of(names, got.values)
            self._declaration = declare(described.descriptors, self._values, self._prefix)
            self._listener.declared(self._declaration.params, self._declaration.node)
            self._listener.updated(self._declaration.decode(self._values))
        return True

    def _changed(self, event: ParameterEvent) -> None:
        if event.new_parameters:  # it has only begun: there may be more
            self._is_there = False
            self._look.set()
        moved = [*event.new_parameters, *event.changed_parameters]
        values = values_of([one.name for one in moved], [one.value for one in moved])
        with self._lock:
            self._values |= values
            if self._declaration is not None and values:
                self._listener.updated(self._declaration.decode(self._values))


class ParameterEvents:
    """Tells of changes of parameters, and which nodes share a process.

    Args:
        session: of this process.
    """

    def __init__(self, session: Ros2Session) -> None:
        self.session = session
        self._listeners: list[tuple[str, Callable[[ParameterEvent], None]]] = []
        self._members: dict[str, tuple[str, ...]] = {}
        self._asked: dict[str, _Question] = {}
        self._subscription = session.node.create_subscription(
            ParameterEvent, "/parameter_events", self._take, qos_profile_parameter_events
        )

    def on_change(
        self, node: str, listener: Callable[[ParameterEvent], None]
    ) -> Callable[[], None]:
        """Call ``listener`` with each event of a node; returns the call that ends it."""
        entry = node, listener
        self._listeners.append(entry)
        return lambda: self._listeners.remove(entry) if entry in self._listeners else None

    def places(self, node: str) -> tuple[str, ...]:
        """The names under which a node has parameters, as far as known; waits for nobody."""
        if node not in self._members:
            if node not in self._asked:
                self._asked[node] = _Question(self.session.node, node)
            answer = self._asked[node].answer()
            if answer is not None:
                self._members[node] = _places(node, answer.values[0] if answer.values else None)
        elif node in self._asked:
            self._asked.pop(node).close()
        return self._members.get(node, ())

    def forget(self, there: set[str]) -> None:
        """Ask anew those that have gone meanwhile, when they are back."""
        for node in self._asked.keys() - there:
            self._asked.pop(node).close()
        for node in set(self._members) - there:
            del self._members[node]

    def where(self, place: str) -> tuple[str, str]:
        """The node that has the parameters of a place, and what their names begin with there."""
        for node, places in tuple(self._members.items()):
            if place in places and place != node:
                return node, f"{place.removeprefix(node + '/')}."
        return place, ""

    def _take(self, event: ParameterEvent) -> None:
        for one in event.new_parameters:
            if one.name == MEMBERS:  # it was asked before it had begun
                self._members[event.node] = _places(event.node, one.value)
        for node, listener in tuple(self._listeners):
            if node == event.node:
                listener(event)


class _Question:
    """Asks a node which nodes share its process; again where no answer comes.

    Args:
        node: of this process.
        name: full name of the node that is asked.
    """

    def __init__(self, node: Node, name: str) -> None:
        self._services = ParameterServices(node, name, [GetParameters])
        self._future: Any = None
        self._asked_s = 0.0

    def answer(self) -> Any:
        """The response; None until it has come."""
        if self._future is not None and self._future.done():
            return self._future.result()
        now_s = time.monotonic()
        if now_s - self._asked_s > _ANSWER_S and self._services.are_ready:
            if self._future is not None:
                self._future.cancel()  # else its client waits for the answer for ever
            self._future, self._asked_s = self._services.get([MEMBERS]), now_s
        return None

    def close(self) -> None:
        """Ask no longer."""
        self._services.close()


def _places(node: str, members: Any) -> tuple[str, ...]:
    names = members.string_array_value if members is not None else []
    return tuple(f"{node}/{one}" for one in names) or (node,)
