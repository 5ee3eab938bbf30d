"""An edge between two parts of the page, which a person drags."""

from __future__ import annotations

from nicegui.element import Element


class Edge(Element, component="edge.js"):
    """Sets the width of the element after it."""
