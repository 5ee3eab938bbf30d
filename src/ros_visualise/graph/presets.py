"""Sets of parameters that are chosen together, by a name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ros_visualise.core.errors import UsageError, did_you_mean
from ros_visualise.graph import Graph

Settings = Mapping[str, Mapping[str, Any]]
"""Node -> parameter -> value."""

_DEFAULT: Settings = {
    "filters": {"gray": True, "threshold_mode": "truncate", "threshold": 255},
    "edge_detector": {"method": "canny", "low": 100, "high": 200, "auto": False, "sigma": 0.0},
}
_DIFFERENCES: Mapping[str, Settings] = {
    "default": {},
    "seed": {"filters": {"threshold": 128}, "edge_detector": {"low": 200, "high": 300}},
    "soft": {"edge_detector": {"low": 30, "high": 90, "sigma": 1.4}},
    "strong": {"edge_detector": {"low": 120, "high": 300, "sigma": 1.0}},
    "automatic": {"edge_detector": {"auto": True, "sigma": 1.0}},
    "gradient": {"edge_detector": {"method": "sobel", "low": 0, "high": 400}},
    "black and white": {"filters": {"threshold_mode": "otsu"}},
}
"""Preset -> its differences from the default; the seed is the package that this one grew from."""

NAMES = tuple(_DIFFERENCES)
"""All presets."""


def check_preset(name: str) -> None:
    """Raise UsageError if there is no preset of this name."""
    if name not in _DIFFERENCES:
        raise UsageError(f"no preset {name!r}{did_you_mean(name, NAMES)}")


def preset(name: str, graph: Graph) -> Settings:
    """The parameters that a preset sets in a graph.

    Raises:
        UsageError: unknown preset, or a graph without its nodes.
    """
    check_preset(name)
    nodes = {member.name for member in graph.members}
    found = {
        node: {**values, **_DIFFERENCES[name].get(node, {})}
        for node, values in _DEFAULT.items()
        if node in nodes
    }
    if not found:
        raise UsageError(f"preset {name}: needs images, which this source lacks")
    return found


def chosen(graph: Graph, current: Mapping[str, Any]) -> str:
    """The preset that the current parameters are; empty if they are custom.

    Args:
        graph: the running graph.
        current: the parameters of its nodes, by the nodes' names.
    """
    for name in NAMES:
        wanted = preset(name, graph)
        if all(_has(current[node], values) for node, values in wanted.items()):
            return name
    return ""


def _has(params: Any, values: Mapping[str, Any]) -> bool:
    # a remote node may have published no parameters yet, or other ones
    found = {name: getattr(params, name, None) for name in values}
    return all(getattr(value, "value", value) == values[name] for name, value in found.items())
