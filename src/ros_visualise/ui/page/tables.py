"""Tables of a run: topics with rates, drops and latencies; distances travelled; losses."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from ros_visualise.graph import Graph
from ros_visualise.runtime.report import NodeReport, RunReport, TopicReport, TravelReport

_HEAD = (
    '<tr><th>Topic<th title="By the message stamps">Hz<th title="Requested rate">Target Hz'
    '<th title="Messages lost; those that a node was set to skip do not count">'
    'Dropped<th title="Median latency from the source until this node is done">ms</tr>'
)


def topic_table(graph: Graph, report: RunReport) -> str:
    """The topics of a run report as a table in HTML."""
    rows = [
        _row(name, topic, report.nodes[graph.topics[name].publisher])
        for name, topic in report.topics.items()
    ]
    rows += [_unknown_row(name, kind) for name, kind in sorted(report.unknown.items())]
    return f'<table class="rv-topics">{_HEAD}{"".join(rows)}</table>'


def travel_lines(report: RunReport) -> str:
    """Distances and speeds of a run report, in HTML."""
    nodes = report.nodes.items()
    return _lines((name, _describe(node.travel)) for name, node in nodes if node.travel)


def loss_lines(report: RunReport) -> str:
    """Unreadable messages of a run report, in HTML."""
    return _lines((name, note) for name, node in report.nodes.items() for note in node.unread)


def end_lines(report: RunReport) -> str:
    """Sources on other machines that have ended, in HTML."""
    ended = (name for name, node in report.nodes.items() if node.ended)
    return _lines((name, "ended; to play it again, clear Paused in its window") for name in ended)


def _lines(lines: Iterable[tuple[str, str]]) -> str:
    return "".join(f'<div class="rv-note">{escape(n)}: {escape(text)}</div>' for n, text in lines)


def _describe(travel: TravelReport) -> str:
    parts = [f"{travel.length_m:.1f} m in {travel.duration_s:.1f} s"]
    for word, mps in (("mean", travel.mean_mps), ("max", travel.top_mps)):
        if mps is not None:
            parts.append(f"{word} {mps:.2f} m/s")
    if travel.refused:
        parts.append(f"{travel.refused} rejected")
    return ", ".join(parts)


def _row(name: str, topic: TopicReport, node: NodeReport) -> str:
    cells = (
        f'<span title="{_number(topic.wall_hz)} per second">{_number(topic.hz)}</span>',
        _number(node.requested_hz),
        f'<span title="{escape(_reasons(node.dropped.items()))}">{node.lost}</span>',
        _number(node.p50_ms),
    )
    return f"<tr>{_name(name, topic.type)}{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"


def _unknown_row(name: str, kind: str) -> str:
    return f'<tr>{_name(name, kind)}<td colspan="4">unsupported type</td></tr>'


def _name(topic: str, kind: str) -> str:
    return f"<td>{escape(topic)}<small>{escape(kind.replace('/msg/', '/'))}</small></td>"


def _reasons(drops: Iterable[tuple[str, int]]) -> str:
    return ", ".join(f"{count} ({reason})" for reason, count in drops) or "none"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f}"
