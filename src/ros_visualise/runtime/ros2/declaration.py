"""What ROS 2 tells of a node's parameters -> a declaration of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor

from ros_visualise.core.params import specs
from ros_visualise.nodes import NodeType, SourceType
from ros_visualise.runtime.playing import offered
from ros_visualise.runtime.remote.declaration import ParameterDescription, declared, name_here
from ros_visualise.runtime.ros2.description import KINDS, describe, limits, plain, step
from ros_visualise.runtime.ros2.session import OF_ROS

_NO_NAME = re.compile(r"\W")


@dataclass(frozen=True)
class Ros2Declaration:
    """A node's parameters here, and how they are called there.

    Attributes:
        params: the dataclass: that of our own node, if it is one of ours, else made for it.
        node: our own node, if it is one.
        names: of a field -> of the parameter.
    """

    params: type
    node: NodeType | SourceType | None
    names: Mapping[str, str]

    def decode(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The values of parameters, by the fields' names."""
        return {here: values[there] for here, there in self.names.items() if there in values}

    def encode(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Fields' values, by the parameters' names."""
        known = {spec.name: spec for spec in specs(self.params)}
        return {self.names[here]: plain(known[here], value) for here, value in values.items()}


def declare(
    told: Sequence[ParameterDescriptor], values: Mapping[str, Any], prefix: str
) -> Ros2Declaration:
    """The declaration for descriptors: our own, if they tell the same, else one made for them.

    Args:
        told: of all parameters of a ROS 2 node.
        values: parameter -> its value now.
        prefix: what the names begin with of those that are meant.
    """
    mine = [one for one in told if _is_meant(one, prefix) and one.name in values]
    key = frozenset(_told(one, prefix) for one in mine if not _is_fixed(one))
    if key in our_own():
        params, node = our_own()[key]
        return Ros2Declaration(params, node, {s.name: prefix + s.name for s in specs(params)})
    names = _fields([one.name for one in mine], prefix)
    by_name = {one.name: one for one in mine}
    made = [_made(field, by_name[n], values[n], prefix) for field, n in names.items()]
    return Ros2Declaration(declared(made), None, names)


@cache
def our_own() -> dict[frozenset[Any], tuple[type, NodeType | SourceType]]:
    """Our own nodes, by what they tell; the first call takes a second of imports."""
    return {
        frozenset(_told(describe(spec, spec.name), "") for spec in specs(kind)): (kind, node)
        for kind, node in offered()
    }


def _is_meant(told: ParameterDescriptor, prefix: str) -> bool:
    return told.name.startswith(prefix) and not told.name.startswith(OF_ROS)


def _is_fixed(told: ParameterDescriptor) -> bool:
    """Whether it can be looked at alone."""
    return bool(told.read_only) or told.type not in KINDS


def _told(told: ParameterDescriptor, prefix: str) -> Any:
    text = told.description, told.additional_constraints
    return told.name.removeprefix(prefix), told.type, *text, limits(told)


def _fields(names: Iterable[str], prefix: str) -> dict[str, str]:
    """Names that fields can have -> those of parameters, which have dots and hyphens in them."""
    fields: dict[str, str] = {}
    for name in names:
        text = _NO_NAME.sub("_", name.removeprefix(prefix))
        field = name_here(text if text.isidentifier() else f"_{text}")
        while field in fields:
            field += "_"
        fields[field] = name
    return fields


def _made(field: str, told: ParameterDescriptor, value: Any, prefix: str) -> ParameterDescription:
    low, high = limits(told)
    name = told.name.removeprefix(prefix)
    return ParameterDescription(
        field,
        KINDS.get(told.type, str),
        value,
        told.description or name,
        low,
        high,
        group=name.rpartition(".")[0],
        step=step(told),
        label=name if name != field else "",
        read_only=_is_fixed(told),
    )
