"""The graph of nodes and topics as a picture: top down, nodes as boxes, topics as text."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from typing import NamedTuple

from ros_visualise.graph import Graph

_ROW, _BOX, _WIDTH = 34.0, 20.0, 320.0
_CHARACTER = 6.6
_HALO = "paint-order:stroke;stroke:var(--mantine-color-body);stroke-width:4px"
"""Of a topic's name, which arrows to the rows below it may cross."""
_ARROW = (
    '<defs><marker id="rv-tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="6" '
    'markerHeight="6" orient="auto"><path d="M0 0L8 4L0 8z" fill="#909296"/></marker></defs>'
)


class _Place(NamedTuple):
    x: float
    y: float


def graph_picture(graph: Graph) -> str:
    """An SVG of a graph; what comes later is drawn lower."""
    if not graph.members:
        return '<div class="rv-note">nobody is there yet</div>'
    rows = [row for layer in _layers(graph) for row in _rows(layer)]
    width = max(_WIDTH, *(_widths(row) for row in rows))
    places = _places(rows, width)
    height = max(place.y for place in places.values()) + _ROW / 2
    lines = "".join(_line(places[a], places[b]) for a, b in _edges(graph))
    nodes = "".join(_node(node.name, places["node", node.name]) for node in graph.members)
    topics = "".join(_topic(n, places["topic", n]) for n in (*graph.inputs, *graph.topics))
    return (
        f'<svg class="rv-graph" viewBox="0 0 {width:g} {height:g}" role="img">'
        f"{_ARROW}{lines}{nodes}{topics}</svg>"
    )


Key = tuple[str, str]


def _edges(graph: Graph) -> list[tuple[Key, Key]]:
    out = [(("node", n.name), ("topic", t)) for n in graph.members for t in n.outputs.values()]
    into = [(("topic", t), ("node", n.name)) for n in graph.members for t in n.inputs.values()]
    return out + into


def _layers(graph: Graph) -> list[list[Key]]:
    """Layers of nodes and topics, each below all that leads to it; unused topics come first."""
    depth: dict[Key, int] = {("topic", topic): 0 for topic in graph.inputs}
    for node in graph.members:  # in the order in which messages pass
        inputs = [("topic", topic) for topic in node.inputs.values()]
        above = [depth[key] for key in inputs if key in depth]  # but for what goes round
        depth["node", node.name] = max(above, default=-1) + 1
        for topic in node.outputs.values():
            depth["topic", topic] = depth["node", node.name] + 1
    taken = {key for key, _ in _edges(graph)}
    layers = [[key for key in depth if depth[key] == d] for d in range(max(depth.values()) + 1)]
    return [sorted(layer, key=lambda key: key in taken) for layer in layers]


def _rows(layer: list[Key]) -> Iterator[list[Key]]:
    """A layer in as many rows as it needs to be read."""
    row: list[Key] = []
    for key in layer:
        if row and _widths([*row, key]) > _WIDTH:
            yield row
            row = []
        row.append(key)
    yield row


def _places(rows: list[list[Key]], width: float) -> dict[Key, _Place]:
    """The place of each; the free room in a row is shared evenly."""
    places: dict[Key, _Place] = {}
    for number, row in enumerate(rows):
        room = (width - _widths(row)) / max(len(row), 1)
        x = 0.0
        for key in row:
            taken = _width(key[1])
            places[key] = _Place(x + (room + taken) / 2, _ROW * (number + 0.5))
            x += room + taken
    return places


def _widths(row: list[Key]) -> float:
    return sum(_width(name) for _, name in row)


def _width(name: str) -> float:
    return len(name) * _CHARACTER + 20


def _line(a: _Place, b: _Place) -> str:
    return (
        f'<path d="M{a.x:g} {a.y + _BOX / 2:g}L{b.x:g} {b.y - _BOX / 2:g}" stroke="#909296" '
        'stroke-width="1.2" fill="none" marker-end="url(#rv-tip)"/>'
    )


def _node(name: str, at: _Place) -> str:
    width = _width(name)
    text = _text(name, at, 'font-weight="600"')
    return (
        f'<rect x="{at.x - width / 2:g}" y="{at.y - _BOX / 2:g}" width="{width:g}" '
        f'height="{_BOX:g}" rx="6" fill="#228be633" stroke="#228be6"/>{text}'
    )


def _topic(name: str, at: _Place) -> str:
    return _text(name, at, f'fill-opacity="0.75" font-family="monospace" style="{_HALO}"')


def _text(text: str, at: _Place, style: str) -> str:
    return (
        f'<text x="{at.x:g}" y="{at.y + 4:g}" text-anchor="middle" font-size="11" '
        f'fill="currentColor" {style}>{escape(text)}</text>'
    )
