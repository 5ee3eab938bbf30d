"""Figures of a run for browsers: topics with rates, drops and latencies, and lines of text."""

from __future__ import annotations

import json
from collections.abc import Iterator

from ros_visualise.graph import Graph
from ros_visualise.runtime.report import RunReport, TravelReport

LIVE_TOPICS = "/live/topics"
"""Path of their WebSocket."""
Cell = str | float | None


def figures(graph: Graph, report: RunReport) -> str:
    """Rows and lines of a run report, as JSON."""
    return json.dumps({"rows": topic_rows(graph, report), "lines": list(lines_of(report))})


def topic_rows(graph: Graph, report: RunReport) -> list[list[Cell]]:
    """The topics of a run report: name, type, Hz, Hz by the wall clock, target Hz, number of
    messages lost and the reasons, median latency in ms; an unsupported topic is its name and type.
    """
    rows: list[list[Cell]] = []
    for name, topic in report.topics.items():
        node = report.nodes[graph.topics[name].publisher]
        reasons = ", ".join(f"{count} ({reason})" for reason, count in node.dropped.items())
        figures = [topic.hz, topic.wall_hz, node.requested_hz, node.lost, reasons, node.p50_ms]
        rows.append([name, _short(topic.type), *figures])
    return rows + [[name, _short(kind)] for name, kind in sorted(report.unknown.items())]


def lines_of(report: RunReport) -> Iterator[str]:
    """Lines about sources that ended, distances travelled and messages lost."""
    for name, node in report.nodes.items():
        if node.ended:
            yield f"{name}: ended; to play it again, clear its parameter Paused"
        if node.travel:
            yield f"{name}: {_describe(node.travel)}"
        yield from (f"{name}: {note}" for note in node.unread)


def _describe(travel: TravelReport) -> str:
    parts = [f"{travel.length_m:.1f} m in {travel.duration_s:.1f} s"]
    for word, mps in (("mean", travel.mean_mps), ("max", travel.top_mps)):
        if mps is not None:
            parts.append(f"{word} {mps:.2f} m/s")
    if travel.refused:
        parts.append(f"{travel.refused} rejected")
    return ", ".join(parts)


def _short(kind: str) -> str:
    return kind.replace("/msg/", "/")
