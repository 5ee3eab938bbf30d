"""What the nodes of this process report on ``/diagnostics``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ros_visualise.core.rate import Clock
from ros_visualise.data import DiagnosticArray, Header
from ros_visualise.messages import type_name
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.middleware import Transport
from ros_visualise.runtime.report import NodeReport, figures_of
from ros_visualise.runtime.statuses import Statuses

GATE = "dropped as asked"
"""The figure that names the reason for the drops that a node is there for."""


@dataclass(frozen=True)
class NodeStatus:
    """What is told of a node: its report, its input topics, and what is counted of its outputs."""

    report: NodeReport
    inputs: Mapping[str, str]
    outputs: Mapping[str, Mapping[str, Any]]

    @property
    def figures(self) -> dict[str, Any]:
        """All of it, which may be nested."""
        report = figures_of(self.report)
        return {**report, GATE: self.report.gate, "inputs": self.inputs, "topics": self.outputs}


class Diagnostics:
    """Publishes one status for each node: what it was asked for, what it achieved, what it lost."""

    def __init__(self, transport: Transport) -> None:
        diagnostics = TopicType(type_name(DiagnosticArray))
        self._publisher = transport.advertise("/diagnostics", diagnostics)
        self._clock: Clock = transport.clock()
        self._statuses = Statuses()

    def publish(self, nodes: Mapping[str, NodeStatus]) -> None:
        """Publish the statuses of nodes, by their full names."""
        if not self._publisher.connections:
            return
        statuses = tuple(
            self._statuses.status(name, told.report, told.figures) for name, told in nodes.items()
        )
        self._publisher.publish(DiagnosticArray(statuses, Header(self._clock.now_ns())))

    def close(self) -> None:
        """Leave the topic."""
        self._publisher.close()
