"""Changes of parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ros_visualise.data.header import Header
from ros_visualise.params import Value


@dataclass(frozen=True)
class ParameterEvent:
    """Parameters of one node at a time: ``new`` as it starts, ``changed`` when one is moved."""

    node: str
    new: Mapping[str, Value] = field(default_factory=dict)
    changed: Mapping[str, Value] = field(default_factory=dict)
    header: Header = Header()
