"""How nodes are doing, by their part of the run report."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

from ros_visualise.data import DiagnosticStatus, Level
from ros_visualise.runtime.report import NodeReport

_PAUSE_S = 2.0
"""Between two questions; after a longer one nobody knows what was lost in the last second."""


class Statuses:
    """Says of nodes, when asked once a second, whether they have lost anything in that second.

    What was lost before anybody asked, or while nobody did, is not of the last second.

    Args:
        clock: monotonic seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lost: dict[str, tuple[int, float]] = {}  # by name: how much there was, and when

    def status(self, name: str, report: NodeReport, figures: Mapping[str, Any]) -> DiagnosticStatus:
        """The status of one node.

        Args:
            name: of the node.
            report: its part of the run report.
            figures: what is told of it, which may be nested.
        """
        now_s = self._clock()
        before, asked_s = self._lost.get(name, (0, -math.inf))
        self._lost[name] = report.lost, now_s
        new = report.lost - before if now_s - asked_s < _PAUSE_S else 0
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
