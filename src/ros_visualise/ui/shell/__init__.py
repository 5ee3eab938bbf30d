"""The shell of the page: what surrounds the panels, built for each browser."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import parse_qs

from nicegui import ui

from ros_visualise.ui.parts import PARTS
from ros_visualise.ui.parts.timeline import Timeline
from ros_visualise.ui.server.gate import Scope, Visit
from ros_visualise.ui.shell.offered import OfferedHub
from ros_visualise.ui.shell.panels import kinds
from ros_visualise.ui.shell.search import Search
from ros_visualise.ui.shell.workspace import LAYOUT, Workspace, read_layout

_FOLDER = Path(__file__).parent
_STYLES = [_FOLDER / "page.css", *sorted((_FOLDER / "panels").glob("*.css"))]
_SCRIPTS = ("rv.js", "nodes.js", "files.js", "regions.js")


class Shell:
    """Builds the page of what is offered."""

    def __init__(self, offered: OfferedHub) -> None:
        self._offered = offered

    def __call__(self, scope: Scope) -> None:
        """Build the page for a browser, within its NiceGUI client."""
        visit: Visit = scope["state"]["visit"]
        ui.page_title(self._offered.title)
        for style in _STYLES:
            ui.add_css(style)
        for name in _SCRIPTS:
            ui.add_head_html(f'<script src="{scope["root_path"]}{PARTS}{name}"></script>')
        if visit.is_foreign:
            ui.add_body_html('<i hidden id="rv-foreign"></i>')
        query = parse_qs(scope["query_string"].decode("latin-1"))
        layout = read_layout(query.get(LAYOUT, [""])[0])
        Workspace(kinds(), layout, self._offered.standard, visit.is_viewer)
        Search(kinds(), visit.is_viewer)
        Timeline(visit.is_viewer).classes("w-full")
