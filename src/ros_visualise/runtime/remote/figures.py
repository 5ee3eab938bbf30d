"""What nodes elsewhere report on ``/diagnostics``, read back as parts of the run report."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from typing import Any

from ros_visualise.data import DiagnosticArray
from ros_visualise.runtime.bridge.diagnostics import GATE
from ros_visualise.runtime.middleware import Transport
from ros_visualise.runtime.report import ENDED, RATES, NodeReport

log = logging.getLogger(__name__)

_FRESH_S = 5.0


class Figures:
    """The newest figures of every node that reports some."""

    def __init__(self, transport: Transport) -> None:
        self._newest: dict[str, tuple[float, Mapping[str, str]]] = {}
        self._subscriber = transport.subscribe(
            "/diagnostics", DiagnosticArray, self._take, lambda why: log.debug("%s", why)
        )

    def node(self, name: str) -> NodeReport:
        """A node's part of the run report; nothing but zeros where it reports nothing."""
        told = self._fresh(name)
        dropped = {k.removeprefix("dropped/"): n for k, n in told.items() if "dropped/" in k[:8]}
        requested_hz = _number(told.get("requested_hz"))
        own: dict[str, Any] = {ENDED: True} if told.get(ENDED) == str(True) else {}
        if requested_hz is not None:
            own["requested_hz"] = requested_hz
        return NodeReport(
            received=int(_number(told.get("received")) or 0),
            processed=int(_number(told.get("processed")) or 0),
            dropped={why: int(n) for why, n in dropped.items() if n.isdecimal()},
            p50_ms=_number(told.get("p50_ms")),
            p99_ms=_number(told.get("p99_ms")),
            step_ms=_number(told.get("step_ms")),
            own=own,
            publishes="achieved_hz" in told,
            achieved_hz=_number(told.get("achieved_hz")),
            gate=told.get(GATE),
        )

    def rates(self, name: str, topic: str) -> list[float | None]:
        """How often a node publishes a topic, by its stamps and each second, as it says itself."""
        told = self._fresh(name)
        return [_number(told.get(f"topics/{topic}/{rate}")) for rate in RATES]

    def outputs(self, name: str) -> set[str]:
        """The topics that a node has ever said to publish."""
        _, told = self._newest.get(name, (0.0, {}))
        keys = [key.removeprefix("topics/") for key in told if key.startswith("topics/")]
        return {key.rpartition("/")[0] for key in keys}

    def inputs(self, name: str) -> set[str]:
        """The topics that a node has ever said to take."""
        _, told = self._newest.get(name, (0.0, {}))
        return {topic for key, topic in told.items() if key.startswith("inputs/")}

    def close(self) -> None:
        """Read no more."""
        self._subscriber.close()

    def _fresh(self, name: str) -> Mapping[str, str]:
        came_s, told = self._newest.get(name, (0.0, {}))
        return told if time.monotonic() - came_s < _FRESH_S else {}

    def _take(self, array: DiagnosticArray) -> None:
        for status in array.statuses:
            name = "/" + "/".join(filter(None, status.name.split("/")))
            self._newest[name] = (time.monotonic(), status.values)


def _number(text: str | None) -> int | float | None:
    try:
        return None if text is None else int(text) if text.isdecimal() else float(text)
    except ValueError:
        return None
