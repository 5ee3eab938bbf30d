"""What the nodes of this process report on ``/diagnostics``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ros_visualise.data import DiagnosticArray, DiagnosticStatus, Header, Level
from ros_visualise.messages import type_name
from ros_visualise.messages.recorded import TopicType
from ros_visualise.rate import Clock
from ros_visualise.runtime.middleware import Middleware


class Diagnostics:
    """Publishes one status for each node: what it was asked for, what it achieved, what it lost."""

    def __init__(self, middleware: Middleware) -> None:
        diagnostics = TopicType(type_name(DiagnosticArray))
        self._publisher = middleware.advertise("/diagnostics", diagnostics)
        self._clock: Clock = middleware.clock()
        self._lost: dict[str, int] = {}

    def publish(self, nodes: Mapping[str, Mapping[str, Any]]) -> None:
        """Publish the statuses: full name of a node -> its figures, which may be nested."""
        if not self._publisher.connections:
            return
        statuses = tuple(self._status(name, report) for name, report in nodes.items())
        self._publisher.publish(DiagnosticArray(statuses, Header(self._clock.now_ns())))

    def _status(self, name: str, report: Mapping[str, Any]) -> DiagnosticStatus:
        lost = sum(n for why, n in report["dropped"].items() if why != "rate")
        new, self._lost[name] = lost - self._lost.get(name, 0), lost
        return DiagnosticStatus(
            name,
            Level.WARN if new else Level.OK,
            f"dropped {new} messages in the last second" if new else "OK",
            {key: str(value) for key, value in _flat(report).items()},
        )


def _flat(report: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """``{"dropped": {"rate": 3}}`` as ``{"dropped/rate": 3}``; what is not known is left out."""
    flat: dict[str, Any] = {}
    for key, value in report.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{key}/")
        elif value is not None:
            flat[prefix + key] = value
    return flat
