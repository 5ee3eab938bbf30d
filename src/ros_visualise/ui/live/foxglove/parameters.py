"""The parameters of nodes as viewers see and set them: ``/NODE.NAME``."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import Parameters, Spec, specs
from ros_visualise.ui.live.foxglove.messages import GivenParameter

Nodes = Mapping[str, Parameters[Any]]


class NodeChange(NamedTuple):
    """New values of some parameters of a node, which are applied as one whole."""

    node: str
    given: list[GivenParameter]

    def apply(self, nodes: Nodes) -> None:
        """Set them.

        Raises:
            ParameterError: an unknown name, or a value of another type or out of its range.
        """
        if self.node not in nodes:
            raise ParameterError(f"no such parameter: {self.given[0].name}")
        parameters = nodes[self.node]
        declared = {spec.name: spec for spec in specs(parameters.current)}
        changes = {}
        for one in self.given:
            name = one.name.rpartition(".")[2]
            if name in declared:
                _check_type(declared[name], one.value)
            changes[name] = one.value
        parameters.update(changes)


def changes_of(given: Iterable[GivenParameter]) -> list[NodeChange]:
    """The changes of each node."""
    changes: dict[str, list[GivenParameter]] = {}
    for one in given:
        node = one.name.rpartition(".")[0].removeprefix("/")
        changes.setdefault(node, []).append(one)
    return [NodeChange(node, values) for node, values in changes.items()]


def values_of(nodes: Nodes, names: Collection[str] | None = None) -> dict[str, Mapping[str, Any]]:
    """Parameters of these names, or all, as they are sent."""
    return {
        name: _as_sent(name, spec, value)
        for name, spec, value in _all(nodes)
        if names is None or name in names
    }


def _all(nodes: Nodes) -> Iterator[tuple[str, Spec, Any]]:
    for node, parameters in nodes.items():
        current = parameters.current
        for spec in specs(current):
            yield f"/{node}.{spec.name}", spec, getattr(current, spec.name)


def _as_sent(name: str, spec: Spec, value: Any) -> Mapping[str, Any]:
    if spec.type is float:
        return {"name": name, "value": float(value), "type": "float64"}
    return {"name": name, "value": getattr(value, "value", value)}


def _check_type(spec: Spec, value: Any) -> None:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if spec.type is bool:
        fits = isinstance(value, bool)
    elif spec.type in (int, float):
        fits = is_number and abs(value) < math.inf
    else:
        fits = isinstance(value, str)
    if not fits:
        kind = {bool: "true or false", int: "a whole number", float: "a finite number"}
        raise ParameterError(f"{spec.name}: must be {kind.get(spec.type, 'a string')}")
