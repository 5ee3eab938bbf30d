"""The tree of frames as a picture: parents above their children, what is known of each between."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

from ros_visualise.ui.scene.links import Link

_ROW, _BOX, _GAP = 58.0, 20.0, 8.0
_CHARACTER, _SMALL = 6.3, 4.6
_SMALLEST = 0.62
"""A wide tree is scaled down so far at most, and then scrolled; a small one is never enlarged."""
_NS = 1_000_000_000
_OLD_S = 1.0


class _Place(NamedTuple):
    x: float
    depth: int


def tree_picture(links: Sequence[Link]) -> str:
    """An SVG of the tree; ages are those against the newest transform of all."""
    if not links:
        return '<div class="rv-note">no transforms yet</div>'
    now_ns = max((link.stamp_ns for link in links if not link.static), default=0)
    places = _places(links)
    width = max(place.x + _half(name) for name, place in places.items()) + 2
    height = _ROW * max(place.depth for place in places.values()) + _BOX + 4
    arrows = "".join(_arrow(link, places, now_ns) for link in links if link.parent in places)
    boxes = "".join(_box(name, place) for name, place in places.items())
    return (
        f'<svg class="rv-graph rv-tree" viewBox="0 0 {width:g} {height:g}" role="img" '
        f'style="min-width:{_SMALLEST * width:.0f}px; max-width:{width:.0f}px">'
        f"{arrows}{boxes}</svg>"
    )


def _places(links: Sequence[Link]) -> dict[str, _Place]:
    """Each subtree takes the width that its widest row needs; parents stand in its middle."""
    children: dict[str, list[Link]] = {}
    for link in links:
        children.setdefault(link.parent, []).append(link)
    below = {link.child for link in links}
    places: dict[str, _Place] = {}
    x = 2.0
    for root in sorted(children.keys() - below) or [links[0].parent]:
        x += _put(root, x, 0, children, places) + _GAP
    return places


def _put(
    name: str, x: float, depth: int, children: dict[str, list[Link]], places: dict[str, _Place]
) -> float:
    """Place a frame and all below it from x on; how wide they are."""
    places[name] = _Place(x, depth)
    first, right = len(places), x
    for link in children.get(name, ()):
        if link.child not in places:
            right += _put(link.child, right, depth + 1, children, places) + _GAP
    below = right - x - _GAP
    width = max(2 * _half(name), below)
    for child in list(places)[first:]:
        places[child] = _Place(places[child].x + (width - below) / 2, places[child].depth)
    places[name] = _Place(x + width / 2, depth)
    return width


def _half(name: str) -> float:
    return max(len(name) * _CHARACTER / 2 + 8, 10 * _SMALL)


def _arrow(link: Link, places: dict[str, _Place], now_ns: int) -> str:
    a, b = places[link.parent], places[link.child]
    y1, y2 = _ROW * a.depth + _BOX + 2, _ROW * b.depth + 2
    color = "#909296" if link.static else "#40c057"
    first, second = _describe(link, now_ns)
    return (
        f'<path d="M{a.x:g} {y1:g}C{a.x:g} {y1 + 12:g} {b.x:g} {y1:g} {b.x:g} {y1 + 14:g}V{y2:g}" '
        f'stroke="{color}" fill="none" stroke-width="1.2"/>'
        + _text(first, b.x + 4, y2 - 13, 8, "start")
        + _text(second, b.x + 4, y2 - 4, 8, "start")
    )


def _describe(link: Link, now_ns: int) -> tuple[str, str]:
    if link.static:
        return "", "static"
    rate = "" if link.rate_hz is None else f"{link.rate_hz:.1f} Hz"
    age_s = (now_ns - link.stamp_ns) / _NS
    return rate, f"{age_s:.1f} s ago" if age_s >= _OLD_S else ""


def _box(name: str, place: _Place) -> str:
    half, y = len(name) * _CHARACTER / 2 + 6, _ROW * place.depth + 2
    return (
        f'<rect x="{place.x - half:g}" y="{y:g}" width="{2 * half:g}" height="{_BOX:g}" rx="6" '
        'fill="#228be633" stroke="#228be6"/>' + _text(name, place.x, y + 14, 11, "middle")
    )


def _text(text: str, x: float, y: float, size: int, anchor: str) -> str:
    if not text:
        return ""
    return (
        f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" font-size="{size}" '
        f'fill="currentColor">{escape(text)}</text>'
    )
