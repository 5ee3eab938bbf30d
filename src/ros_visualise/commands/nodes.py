"""``nodes``: every node with its topics, actions and parameters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ros_visualise.commands import Command
from ros_visualise.core.printing import print_json, print_result
from ros_visualise.running.arguments import option

if TYPE_CHECKING:
    from ros_visualise.core.params import Spec
    from ros_visualise.nodes import NodeType, SourceType


@dataclass(frozen=True)
class NodesOptions:
    """Options of ``nodes``."""

    json: bool = option(False, "print the list as one JSON object")


def run(options: NodesOptions) -> int:
    """Print every node with its topics, actions and parameters."""
    from ros_visualise.nodes import find_all

    described = {found.name: _describe(found) for found in find_all()}
    if options.json:
        print_json(described)
    else:
        print_result(_lines(described))
    return 0


def _lines(described: dict[str, Any]) -> Iterator[str]:
    for name, node in described.items():
        yield f"{name}: {node['doc']}"
        for side in ("inputs", "outputs", "actions"):
            if node[side]:
                yield f"  {side}: " + ", ".join(f"{n} ({what})" for n, what in node[side].items())
        for param, about in node["params"].items():
            yield f"  {param:<20} {about['default']!s:<16} {_allowed(about):<28} {about['help']}"
        yield ""


def _describe(found: NodeType | SourceType) -> dict[str, Any]:
    from ros_visualise.core.params import specs
    from ros_visualise.nodes import SourceType

    return {
        "doc": found.doc,
        "source": isinstance(found, SourceType),
        "inputs": {port: kind.type_name for port, kind in found.inputs.items()},
        "outputs": {port: kind.type_name for port, kind in found.outputs.items()},
        "actions": dict(found.actions),
        "params": {spec.name: _describe_param(spec) for spec in specs(found.params)},
    }


def _describe_param(spec: Spec) -> dict[str, Any]:
    return {
        "type": "enum" if spec.choices else spec.type.__name__,
        "default": getattr(spec.default, "value", spec.default),
        "min": spec.min,
        "max": spec.max,
        "choices": list(spec.choices),
        "help": spec.help,
    }


def _allowed(about: dict[str, Any]) -> str:
    if about["choices"]:
        return ", ".join(about["choices"])
    if about["min"] is not None and about["max"] is not None:
        return f"{about['type']} {_number(about['min'])} to {_number(about['max'])}"
    return str(about["type"])


def _number(number: float) -> str:
    return str(number) if isinstance(number, int) else f"{number:g}"


COMMAND = Command("list all nodes with their topics, actions and parameters", NodesOptions, run)
