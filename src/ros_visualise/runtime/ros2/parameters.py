"""Our nodes' live parameters as parameters of the process's ROS 2 node."""

from __future__ import annotations

import logging
import threading
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.parameter import Parameter

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import Parameters, specs
from ros_visualise.runtime.ros2.clock import uses_sim_time
from ros_visualise.runtime.ros2.descriptions import describe, to_parameters, wanted
from ros_visualise.runtime.ros2.session import Ros2Session

log = logging.getLogger(__name__)

MEMBERS = "members"
"""The parameter that names the nodes of a process, which the names of their own begin with."""

_SIM_TIME = "use_sim_time"
_CLOSE_S = 0.5
_AGAIN_S = 0.5


class ParameterDesk:
    """Answers for all parameters of a ROS 2 node: a request is applied as a whole or refused.

    Args:
        session: of this process.
    """

    def __init__(self, session: Ros2Session) -> None:
        self.session, self.node = session, session.node
        self._served: dict[str, Ros2ServedParameters] = {}
        self._members: set[str] = set()
        self._shown: dict[str, Any] = {}
        self._pushing = threading.local()
        self.lock = threading.RLock()
        self.node.convert = self._converted
        self.node.add_on_set_parameters_callback(self._on_set)

    def expect(self, namespace: str) -> None:
        """A node of this process is going to have its parameters there.

        Args:
            namespace: what their names begin with; empty for those of the process's only node.
        """
        if namespace:
            self._members.add(namespace)

    def show(self, name: str, value: Any) -> None:
        """Have an option of the process among its parameters, unless it turns out to be a live one.

        Args:
            name: of the option.
            value: given, or the default.
        """
        self._shown[name] = value

    def serve(self, parameters: Parameters[Any], namespace: str) -> Ros2ServedParameters:
        """Declare a node's parameters, until that is closed."""
        return Ros2ServedParameters(self, parameters, f"{namespace}." if namespace else "")

    def add(self, served: Ros2ServedParameters) -> None:
        """Have requests for these parameters answered."""
        self._served[served.prefix] = served
        if self._members:
            self._declare_fixed({MEMBERS: sorted(self._members)}, "the nodes of this process")
        options = {name: value for name, value in self._shown.items() if "/" not in name}
        self._declare_fixed(options, "read when the node starts")

    def remove(self, served: Ros2ServedParameters) -> None:
        """Answer no longer, and have them declared no longer."""
        with self.lock:
            self._served.pop(served.prefix, None)
            for name in served.published:
                self.node.undeclare_parameter(name)

    def declare(self, parameters: Sequence[tuple[str, Any, ParameterDescriptor]]) -> None:
        """Declare parameters with these values, as they are here."""
        self._pushing.on = True
        try:
            self.node.declare_parameters("", list(parameters), ignore_override=True)
        finally:
            self._pushing.on = False

    def _declare_fixed(self, values: Mapping[str, Any], description: str) -> None:
        """Declare those that are not there yet, and that nobody can change."""
        about = {"read_only": True, "description": description}
        new = [name for name in values if not self.node.has_parameter(name)]
        # a descriptor for each: rclpy writes the type of the value into it
        self.declare([(name, values[name], ParameterDescriptor(**about)) for name in new])

    def push(self, parameters: list[Parameter]) -> None:
        """Tell the graph of values that are there."""
        self._pushing.on = True
        try:
            self.node.set_parameters_atomically(parameters)
        finally:
            self._pushing.on = False

    def _converted(self, asked: Parameter) -> Parameter:
        for served in self._served.values():
            if asked.name in served.published:
                return served.converted(asked)
        return asked

    def _on_set(self, asked: list[Parameter]) -> SetParametersResult:
        """Apply what is asked for as one whole, or refuse it and say why."""
        if getattr(self._pushing, "on", False):
            return SetParametersResult(successful=True)
        for one in asked:
            if one.name == _SIM_TIME and one.value != uses_sim_time(self.node):
                again = f"start it again with -p {_SIM_TIME}:={str(one.value).lower()}"
                reason = f"{_SIM_TIME} is read when the node starts; {again}"
                return SetParametersResult(successful=False, reason=reason)
        changes: dict[Ros2ServedParameters, dict[str, Any]] = defaultdict(dict)
        for one in asked:
            for served in self._served.values():
                if one.name in served.published:
                    changes[served][one.name.removeprefix(served.prefix)] = one.value
        try:
            with self.lock:
                _apply_all(changes)
                for served, changed in changes.items():
                    served.published |= {served.prefix + name: one for name, one in changed.items()}
        except ParameterError as error:
            log.warning("rejected: %s", error)
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)


class Ros2ServedParameters:
    """Offers a node's parameters, for as long as it is open.

    A thread of its own publishes what is changed elsewhere: no lock is held by a
    thread that changes a parameter while ROS is talked to.

    Args:
        desk: of the process's ROS 2 node.
        parameters: what is offered.
        prefix: what their names begin with there.

    Attributes:
        published: their values as the graph knows them, by their names there.
    """

    def __init__(self, desk: ParameterDesk, parameters: Parameters[Any], prefix: str) -> None:
        self.prefix = prefix
        self.parameters = parameters
        self._desk = desk
        self._specs = specs(parameters.current)
        self._changed = threading.Event()
        self._closed = False
        values = to_parameters(prefix, self._specs, parameters.current)
        self.published = {one.name: one.value for one in values}
        self._desk.declare(
            [
                (one.name, one.value, describe(spec, one.name))
                for spec, one in zip(self._specs, values, strict=True)
            ]
        )
        desk.add(self)
        self._forget = parameters.on_change(lambda *_: self._changed.set())
        name = f"parameters {prefix}".rstrip(" .")
        self._thread = desk.session.start(name, self._follow, again_s=_AGAIN_S)

    def converted(self, asked: Parameter) -> Parameter:
        """A requested value in the declared type; unchanged where that cannot be, to be refused."""
        name = asked.name.removeprefix(self.prefix)
        spec = next(one for one in self._specs if one.name == name)
        return Parameter(asked.name, value=wanted(spec, asked.value))

    def close(self) -> None:
        """Offer them no longer; more than once does no harm."""
        if self._closed:
            return
        self._closed = True
        self._forget()
        self._changed.set()
        self._thread.join(_CLOSE_S)
        self._desk.remove(self)

    def _follow(self) -> None:
        while not self._closed:
            self._changed.wait()
            self._changed.clear()
            if not self._closed:
                self._tell()

    def _tell(self) -> None:
        """Tell the graph of what has changed here, and not by its own request."""
        with self._desk.lock:  # a request that is being applied is published by ROS itself
            values = to_parameters(self.prefix, self._specs, self.parameters.current)
            changed = [one for one in values if one.value != self.published[one.name]]
            if changed:
                self.published |= {one.name: one.value for one in changed}
                self._desk.push(changed)


def _apply_all(changes: Mapping[Ros2ServedParameters, Mapping[str, Any]]) -> None:
    """Apply changes of several nodes; where one refuses, the others get back what they had."""
    before: list[tuple[Parameters[Any], dict[str, Any]]] = []
    try:
        for served, asked in changes.items():
            had = {name: getattr(served.parameters.current, name) for name in asked}
            served.parameters.update(asked)
            before.append((served.parameters, had))
    except ParameterError:
        for parameters, had in before:
            parameters.update(had)
        raise
