"""Layouts of diagrams: a tree with a row for each name, and a graph of nodes and topics."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

Key = tuple[str, str]
"""``node`` or ``topic``, and its name."""


class TreeRow(NamedTuple):
    """A name in a tree: its depth, and the row of its parent; None for a root."""

    name: str
    depth: int
    parent: int | None


def tree_rows(parents: Mapping[str, str]) -> list[TreeRow]:
    """Rows of a forest, each name above its children, siblings in order; cycles are cut.

    Args:
        parents: child -> parent.
    """
    children: dict[str, list[str]] = {}
    for child, parent in parents.items():
        children.setdefault(parent, []).append(child)
    roots = [*(name for name in children if name not in parents), *children]
    rows: dict[str, TreeRow] = {}
    waiting = [TreeRow(root, 0, None) for root in reversed(roots)]
    while waiting:
        row = waiting.pop()
        if row.name not in rows:
            below = reversed(children.get(row.name, ()))
            waiting += (TreeRow(child, row.depth + 1, len(rows)) for child in below)
            rows[row.name] = row
    return list(rows.values())


class DiagramNode(NamedTuple):
    """A node of a graph, and the topics that it subscribes to and publishes."""

    name: str
    inputs: Sequence[str]
    outputs: Sequence[str]


class Place(NamedTuple):
    """The centre of a box or a name."""

    x: float
    y: float


class GraphLayout:
    """A graph from the top down: each name is below those that lead to it.

    Args:
        nodes: at least one, in the order in which messages pass them.
        width: width of the diagram; a longer name makes it wider.
        row: height of a row.
        character: width of a letter.

    Attributes:
        width, height: size of the diagram.
        places: place of each node and topic.
        arrows: pairs of what they lead from and to.
    """

    def __init__(
        self, nodes: Sequence[DiagramNode], width: float, row: float, character: float
    ) -> None:
        self._character = character
        self.arrows: list[tuple[Key, Key]] = [
            *((("node", n.name), ("topic", topic)) for n in nodes for topic in n.outputs),
            *((("topic", topic), ("node", n.name)) for n in nodes for topic in n.inputs),
        ]
        rows = [line for layer in self._layers(nodes) for line in self._rows(layer, width)]
        self.width = max(width, *map(self._length, rows))
        self.height = row * len(rows)
        self.places = {
            key: Place(x, row * (number + 0.5))
            for number, line in enumerate(rows)
            for key, x in self._spread(line)
        }

    def width_of(self, name: str) -> float:
        """Width of a node's box."""
        return len(name) * self._character + 20

    def _layers(self, nodes: Sequence[DiagramNode]) -> list[list[Key]]:
        """Layers of nodes and topics; topics without subscribers come first in theirs."""
        published = {topic for node in nodes for topic in node.outputs}
        taken = [("topic", topic) for node in nodes for topic in node.inputs]
        depth: dict[Key, int] = {key: 0 for key in taken if key[1] not in published}
        for node in nodes:
            above = [depth[key] for topic in node.inputs if (key := ("topic", topic)) in depth]
            depth["node", node.name] = max(above, default=-1) + 1
            for topic in node.outputs:
                depth["topic", topic] = depth["node", node.name] + 1
        layers = [[key for key in depth if depth[key] == d] for d in range(max(depth.values()) + 1)]
        leading = {key for key, _ in self.arrows}
        return [sorted(layer, key=leading.__contains__) for layer in layers]

    def _rows(self, layer: list[Key], width: float) -> Iterator[list[Key]]:
        """A layer in as many rows as it needs to be readable."""
        row: list[Key] = []
        for key in layer:
            if row and self._length([*row, key]) > width:
                yield row
                row = []
            row.append(key)
        yield row

    def _length(self, row: list[Key]) -> float:
        return sum(self.width_of(name) for _, name in row)

    def _spread(self, row: list[Key]) -> Iterator[tuple[Key, float]]:
        """Each of a row, and the x of its centre; free space is shared evenly."""
        space = (self.width - self._length(row)) / max(len(row), 1)
        x = 0.0
        for key in row:
            taken = space + self.width_of(key[1])
            yield key, x + taken / 2
            x += taken
