"""What the nodes of this process report on /diagnostics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from ros_visualise.runtime.ros1.transport import Publisher


class Diagnostics:
    """Publishes one status for each node: what it was asked for, what it achieved, what it lost."""

    def __init__(self) -> None:
        self._publisher = Publisher("/diagnostics", DiagnosticArray)
        self._lost: dict[str, int] = {}

    def publish(self, nodes: Mapping[str, Mapping[str, Any]]) -> None:
        """Publish the statuses: full name of a node -> its figures, which may be nested."""
        if not self._publisher.connections:
            return
        array = DiagnosticArray()
        array.header.stamp = rospy.Time.now()
        array.status = [self._status(name, report) for name, report in nodes.items()]
        self._publisher.publish(array)

    def _status(self, name: str, report: Mapping[str, Any]) -> DiagnosticStatus:
        lost = sum(n for why, n in report["dropped"].items() if why != "rate")
        new, self._lost[name] = lost - self._lost.get(name, 0), lost
        return DiagnosticStatus(
            level=DiagnosticStatus.WARN if new else DiagnosticStatus.OK,
            name=name,
            message=f"dropped {new} messages in the last second" if new else "OK",
            values=[KeyValue(key, str(value)) for key, value in _flat(report).items()],
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
