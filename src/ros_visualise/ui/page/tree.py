"""The tree of frames as a picture: children indented below their parents.

Every frame has a row of its own: with many, the picture is long, but no wider than their names.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from ros_visualise.plotting.diagrams import TreeRow, tree_rows
from ros_visualise.ui.scene.frames import Link

_ROW, _BOX, _INDENT, _MARGIN = 24.0, 19.0, 16.0, 2.0
_CHARACTER, _SMALL = 6.3, 4.9
_SMALLEST = 0.7
"""A wide picture is scaled down so far at most, and then scrolled; none is enlarged."""
_STILL, _MOVING = "#909296", "#40c057"
_NS = 1_000_000_000
_OLD_S = 1.0


def tree_picture(links: Sequence[Link]) -> str:
    """An SVG of the tree; ages are those against the newest transform of all."""
    if not links:
        return '<div class="rv-note">No transforms yet</div>'
    now_ns = max((link.stamp_ns for link in links if not link.static), default=0)
    by_child = {link.child: link for link in links}
    rows = tree_rows({link.child: link.parent for link in links})
    pairs = [
        (row, "" if row.parent is None else _describe(by_child[row.name], now_ns)) for row in rows
    ]
    width = max(_right(row) + len(note) * _SMALL for row, note in pairs) + _MARGIN
    lines = "".join(
        _line(number, row, by_child[row.name].static)
        for number, row in enumerate(rows)
        if row.parent is not None
    )
    frames = "".join(_frame(number, *pair) for number, pair in enumerate(pairs))
    return (
        f'<svg class="rv-graph rv-tree" viewBox="0 0 {width:g} {_ROW * len(rows):g}" role="img" '
        'aria-label="Tree of frames" '
        f'style="min-width:{_SMALLEST * width:.0f}px; max-width:{width:.0f}px; margin-left:0">'
        f"{lines}{frames}</svg>"
    )


def _describe(link: Link, now_ns: int) -> str:
    if link.static:
        return "static"
    age_s = (now_ns - link.stamp_ns) / _NS
    parts = [] if link.rate_hz is None else [f"{link.rate_hz:.1f} Hz"]
    if age_s >= _OLD_S:
        parts.append(f"{age_s:.1f} s ago")
    return ", ".join(parts)


def _left(row: TreeRow) -> float:
    return _MARGIN + _INDENT * row.depth


def _right(row: TreeRow) -> float:
    """The place of a frame's note."""
    return _left(row) + len(row.name) * _CHARACTER + 18


def _line(number: int, row: TreeRow, is_static: bool) -> str:
    assert row.parent is not None
    x = _left(row) - _INDENT / 2
    top, middle = _ROW * row.parent + _BOX, _ROW * number + _BOX / 2
    color = _STILL if is_static else _MOVING
    return (
        f'<path d="M{x:g} {top:g}V{middle:g}H{_left(row):g}" '
        f'stroke="{color}" fill="none" stroke-width="1.2"/>'
    )


def _frame(number: int, row: TreeRow, note: str) -> str:
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
