"""The parameter services of another node.

rclpy's own class for them is missing in Humble, and cannot be closed in later ones.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParametersAtomically,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

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
        """Whether the node offers all of them."""
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
