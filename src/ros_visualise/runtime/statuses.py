"""How nodes are doing, by their part of the run report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ros_visualise.data import DiagnosticStatus, Level
from ros_visualise.runtime.report import NodeReport


class Statuses:
    """Says of nodes whether they have lost anything since they were asked for last."""

    def __init__(self) -> None:
        self._lost: dict[str, int] = {}

    def status(self, name: str, report: NodeReport, figures: Mapping[str, Any]) -> DiagnosticStatus:
        """The status of one node.

        Args:
            name: of the node.
            report: its part of the run report.
            figures: what is told of it, which may be nested.
        """
        new, self._lost[name] = report.lost - self._lost.get(name, 0), report.lost
        return DiagnosticStatus(
            name,
            Level.WARN if new else Level.OK,
            f"dropped {new} messages in the last second" if new else "OK",
            {key: str(value) for key, value in _flat(figures).items()},
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
