"""The graph of nodes and topics as a picture: top down, nodes as boxes, topics as text."""

from __future__ import annotations

from html import escape

from ros_visualise.graph import Graph
from ros_visualise.plotting.diagrams import DiagramNode, GraphLayout, Place

_ROW, _BOX, _WIDTH = 34.0, 20.0, 320.0
_CHARACTER = 6.6
_HALO = "paint-order:stroke;stroke:var(--rv-body);stroke-width:4px"
"""The halo of a topic's name, which arrows may cross."""
_ARROW = (
    '<defs><marker id="rv-tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="6" '
    'markerHeight="6" orient="auto"><path d="M0 0L8 4L0 8z" fill="#909296"/></marker></defs>'
)


def graph_picture(graph: Graph) -> str:
    """An SVG of a graph."""
    if not graph.members:
        return '<div class="rv-note">No nodes yet</div>'
    nodes = [
        DiagramNode(node.name, list(node.inputs.values()), list(node.outputs.values()))
        for node in graph.members
    ]
    layout = GraphLayout(nodes, _WIDTH, _ROW, _CHARACTER)
    lines = "".join(_line(layout.places[a], layout.places[b]) for a, b in layout.arrows)
    names = "".join(
        _node(name, place, layout.width_of(name)) if kind == "node" else _topic(name, place)
        for (kind, name), place in sorted(layout.places.items())
    )
    return (
        f'<svg class="rv-graph" viewBox="0 0 {layout.width:g} {layout.height:g}" role="img"'
        f' aria-label="Nodes and topics">{_ARROW}{lines}{names}</svg>'
    )


def _line(a: Place, b: Place) -> str:
    return (
        f'<path d="M{a.x:g} {a.y + _BOX / 2:g}L{b.x:g} {b.y - _BOX / 2:g}" stroke="#909296" '
        'stroke-width="1.2" fill="none" marker-end="url(#rv-tip)"/>'
    )


def _node(name: str, at: Place, width: float) -> str:
    text = _text(name, at, 'font-weight="600"')
    return (
        f'<rect x="{at.x - width / 2:g}" y="{at.y - _BOX / 2:g}" width="{width:g}" '
        f'height="{_BOX:g}" rx="6" fill="#228be633" stroke="#228be6"/>{text}'
    )


def _topic(name: str, at: Place) -> str:
    return _text(name, at, f'fill-opacity="0.75" font-family="monospace" style="{_HALO}"')


def _text(text: str, at: Place, style: str) -> str:
    return (
        f'<text x="{at.x:g}" y="{at.y + 4:g}" text-anchor="middle" font-size="11" '
        f'fill="currentColor" {style}>{escape(text)}</text>'
    )
