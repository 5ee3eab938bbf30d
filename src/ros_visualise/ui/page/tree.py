"""The tree of frames as a picture: children indented below their parents.

Every frame has a row of its own: with many, the picture is long, but no wider than their names.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

from ros_visualise.ui.scene.links import Link

_ROW, _BOX, _INDENT, _MARGIN = 24.0, 19.0, 16.0, 2.0
_CHARACTER, _SMALL = 6.3, 4.9
_SMALLEST = 0.7
"""A wide picture is scaled down so far at most, and then scrolled; none is enlarged."""
_STILL, _MOVING = "#909296", "#40c057"
_NS = 1_000_000_000
_OLD_S = 1.0


class _Row(NamedTuple):
    """A frame: how deep in the tree, the row of its parent, and the link to that, if any."""

    name: str
    depth: int
    parent: int
    link: Link | None


def tree_picture(links: Sequence[Link]) -> str:
    """An SVG of the tree; ages are those against the newest transform of all."""
    if not links:
        return '<div class="rv-note">no transforms yet</div>'
    now_ns = max((link.stamp_ns for link in links if not link.static), default=0)
    rows = _rows(links)
    notes = ["" if row.link is None else _describe(row.link, now_ns) for row in rows]
    pairs = list(zip(rows, notes, strict=True))
    width = max(_right(row) + len(note) * _SMALL for row, note in pairs) + _MARGIN
    lines = "".join(_line(number, row) for number, row in enumerate(rows))
    frames = "".join(_frame(number, *pair) for number, pair in enumerate(pairs))
    return (
        f'<svg class="rv-graph rv-tree" viewBox="0 0 {width:g} {_ROW * len(rows):g}" role="img" '
        f'style="min-width:{_SMALLEST * width:.0f}px; max-width:{width:.0f}px; margin-left:0">'
        f"{lines}{frames}</svg>"
    )


def _rows(links: Sequence[Link]) -> list[_Row]:
    """Each frame above all that hang below it."""
    children: dict[str, list[Link]] = {}
    for link in links:
        children.setdefault(link.parent, []).append(link)
    roots = sorted(children.keys() - {link.child for link in links}) or [links[0].parent]
    rows: list[_Row] = []
    passed: set[str] = set()
    waiting = [_Row(root, 0, 0, None) for root in reversed(roots)]
    while waiting:
        row = waiting.pop()
        if row.name not in passed:  # of frames that go round
            passed.add(row.name)
            waiting += _below(row, len(rows), children)
            rows.append(row)
    return rows


def _below(row: _Row, number: int, children: dict[str, list[Link]]) -> Iterator[_Row]:
    for link in reversed(children.get(row.name, [])):
        yield _Row(link.child, row.depth + 1, number, link)


def _describe(link: Link, now_ns: int) -> str:
    if link.static:
        return "static"
    age_s = (now_ns - link.stamp_ns) / _NS
    parts = [] if link.rate_hz is None else [f"{link.rate_hz:.1f} Hz"]
    if age_s >= _OLD_S:
        parts.append(f"{age_s:.1f} s ago")
    return ", ".join(parts)


def _left(row: _Row) -> float:
    return _MARGIN + _INDENT * row.depth


def _right(row: _Row) -> float:
    """Where what is known of a frame is written."""
    return _left(row) + len(row.name) * _CHARACTER + 18


def _line(number: int, row: _Row) -> str:
    if row.link is None:
        return ""
    x = _left(row) - _INDENT / 2
    top, middle = _ROW * row.parent + _BOX, _ROW * number + _BOX / 2
    color = _STILL if row.link.static else _MOVING
    return (
        f'<path d="M{x:g} {top:g}V{middle:g}H{_left(row):g}" '
        f'stroke="{color}" fill="none" stroke-width="1.2"/>'
    )


def _frame(number: int, row: _Row, note: str) -> str:
    x, y = _left(row), _ROW * number + 1
    width = _right(row) - x - 6
    return (
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{_BOX - 2:g}" rx="5" '
        'fill="#228be633" stroke="#228be6"/>'
        + _text(row.name, x + 6, y + 12.5, 11)
        + _text(note, _right(row), y + 12, 9)
    )


def _text(text: str, x: float, y: float, size: int) -> str:
    if not text:
        return ""
    return f'<text x="{x:g}" y="{y:g}" font-size="{size}" fill="currentColor">{escape(text)}</text>'
