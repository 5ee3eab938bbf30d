"""Reports of nodes as ``/diagnostics``: published for nodes here, read back for remote ones."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

from ros_visualise.core.printing import counted
from ros_visualise.core.rate import Clock
from ros_visualise.data import DiagnosticArray, DiagnosticStatus, Header, Level
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.middleware import Transport
from ros_visualise.runtime.report import NodeReport, OutputReport

log = logging.getLogger(__name__)

_TOPIC = "/diagnostics"
_GATE = "dropped as requested"
_PAUSE_S = 2.0
"""Longest time between two calls that counts as one second."""

_FRESH_S = 5.0


class StatusMaker:
    """Makes a node's status: a warning if it dropped messages in the last second.

    To be asked once a second; drops from before a longer pause are not reported.

    Args:
        clock: monotonic seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lost: dict[str, tuple[int, float]] = {}  # name -> drops by then, and when

    def status(self, name: str, report: NodeReport, figures: Mapping[str, Any]) -> DiagnosticStatus:
        """The status of one node, with these figures of its report as values."""
        now_s = self._clock()
        before, asked_s = self._lost.get(name, (0, -math.inf))
        self._lost[name] = report.lost, now_s
        new = report.lost - before if now_s - asked_s < _PAUSE_S else 0
        return DiagnosticStatus(
            name,
            Level.WARN if new else Level.OK,
            f"dropped {counted(new, 'message')} in the last second" if new else "OK",
            {key: str(value) for key, value in _flat(figures).items()},
        )


class DiagnosticsPublisher:
    """Publishes one status for each node: its target, its rates and its losses."""

    def __init__(self, transport: Transport) -> None:
        self._publisher = transport.advertise(_TOPIC, TopicType(DiagnosticArray.type_name))
        self._clock: Clock = transport.clock()
        self._statuses = StatusMaker()

    def publish(self, nodes: Mapping[str, NodeReport]) -> None:
        """Publish the reports of nodes, by their full names."""
        if self._publisher.connections:
            statuses = (
                self._statuses.status(name, node, _published(node)) for name, node in nodes.items()
            )
            array = DiagnosticArray(tuple(statuses), Header(self._clock.now_ns()))
            self._publisher.publish(array)

    def close(self) -> None:
        """Close the topic."""
        self._publisher.close()


class DiagnosticsReader:
    """The newest reports of remote nodes."""

    def __init__(self, transport: Transport) -> None:
        self._newest: dict[str, tuple[float, Mapping[str, str]]] = {}
        self._subscriber = transport.subscribe(
            _TOPIC, DiagnosticArray, self._take, lambda why: log.debug("%s", why)
        )

    def report(self, name: str, stale: bool = False) -> NodeReport:
        """The report of a node; an empty one if it has published none lately.

        Args:
            name: full name of the node.
            stale: take an old one as well.
        """
        came_s, values = self._newest.get(name, (-math.inf, {}))
        is_fresh = time.monotonic() - came_s < _FRESH_S
        return _read(values) if stale or is_fresh else NodeReport()

    def close(self) -> None:
        """Close the topic."""
        self._subscriber.close()

    def _take(self, array: DiagnosticArray) -> None:
        for status in array.statuses:
            name = "/" + "/".join(filter(None, status.name.split("/")))
            self._newest[name] = (time.monotonic(), status.values)


def _published(report: NodeReport) -> dict[str, Any]:
    outputs = {topic: asdict(output) for topic, output in report.outputs.items()}
    return {**report.figures(), _GATE: report.gate, "inputs": report.inputs, "topics": outputs}


def _read(values: Mapping[str, str]) -> NodeReport:
    """The report that a status was made from; other values are ignored."""
    dropped = _below("dropped/", values)
    topics = _below("topics/", values)
    own: dict[str, Any] = {"ended": True} if values.get("ended") == str(True) else {}
    if (requested_hz := _number(values.get("requested_hz"))) is not None:
        own["requested_hz"] = requested_hz
    return NodeReport(
        received=_count(values.get("received")),
        processed=_count(values.get("processed")),
        dropped={why: n for why, count in dropped.items() if (n := _count(count))},
        p50_ms=_number(values.get("p50_ms")),
        p99_ms=_number(values.get("p99_ms")),
        step_ms=_number(values.get("step_ms")),
        own=own,
        inputs=_below("inputs/", values),
        outputs={
            topic: OutputReport(
                _number(topics.get(f"{topic}/hz")),
                _number(topics.get(f"{topic}/wall_hz")),
                _count(topics.get(f"{topic}/dropped")),
            )
            for topic in dict.fromkeys(key.rpartition("/")[0] for key in topics)
        },
        gate=values.get(_GATE),
    )


def _below(prefix: str, values: Mapping[str, str]) -> dict[str, str]:
    return {key.removeprefix(prefix): v for key, v in values.items() if key.startswith(prefix)}


def _flat(figures: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """``{"dropped": {"rate": 3}}`` as ``{"dropped/rate": 3}``; without values of None."""
    flat: dict[str, Any] = {}
    for key, value in figures.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{key}/")
        elif value is not None:
            flat[prefix + key] = value
    return flat


def _number(text: str | None) -> float | None:
    try:
        return None if text is None else int(text) if text.isdecimal() else float(text)
    except ValueError:
        return None


def _count(text: str | None) -> int:
    return int(_number(text) or 0) if text is not None and text.isdecimal() else 0
