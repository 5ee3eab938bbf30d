"""A place for viser's page, which loads beside the page around it."""

from __future__ import annotations

from html import escape

from nicegui import ui
from nicegui.element import Element


class Frame(Element, component="frame.js"):
    """Room at the page's top left for a frame that shows an address."""

    def __init__(self, address: str) -> None:
        super().__init__()
        ui.add_body_html(f'<iframe id="rv-viser" src="{escape(address)}" title="Graph"></iframe>')
