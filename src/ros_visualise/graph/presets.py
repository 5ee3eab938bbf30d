"""Sets of parameters that are chosen together, by a name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ros_visualise.core.errors import UsageError, did_you_mean
from ros_visualise.graph import Graph

Settings = Mapping[str, Mapping[str, Any]]
"""Node -> parameter -> value."""

_PLAIN: Settings = {
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
"""From `_PLAIN`. The seed is the package that this one grows out of."""

NAMES = tuple(_DIFFERENCES)
"""Of all presets."""


def preset(name: str, graph: Graph) -> Settings:
    """What a preset sets of the nodes that are in a graph.

    Raises:
        UsageError: there is no such preset, or nothing that it sets.
    """
    if name not in _DIFFERENCES:
        raise UsageError(f"no preset {name!r}{did_you_mean(name, NAMES)}")
    there = {member.name for member in graph.members} & _PLAIN.keys()
    if not there:
        raise UsageError(f"preset {name}: there are no images here that it would change")
    changes = _DIFFERENCES[name]
    return {node: {**_PLAIN[node], **changes.get(node, {})} for node in _PLAIN if node in there}


def chosen(graph: Graph, current: Mapping[str, Any]) -> str:
    """The preset that the present values make; empty where they are somebody's own.

    Args:
        graph: what runs.
        current: the parameters of its nodes, by the nodes' names.
    """
    for name in NAMES:
        wanted = preset(name, graph)
        if all(_has(current[node], values) for node, values in wanted.items()):
            return name
    return ""


def _has(params: Any, values: Mapping[str, Any]) -> bool:
    # of a node elsewhere that has not told of any yet, or that is only called so, there are none
    found = {name: getattr(params, name, None) for name in values}
    return all(getattr(value, "value", value) == values[name] for name, value in found.items())
