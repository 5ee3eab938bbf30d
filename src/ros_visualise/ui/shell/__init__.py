"""The shell of the page: what surrounds the panels, built for each browser."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import parse_qs

from nicegui import Client, ui

from ros_visualise.ui.parts import PARTS
from ros_visualise.ui.parts.timeline import Timeline
from ros_visualise.ui.server.gate import Scope, Visit
from ros_visualise.ui.server.host import page_loop
from ros_visualise.ui.shell.workspace import LAYOUT, Workspace, read_layout

VISER = "/viser"
FOREIGN = "foreign"
"""Path of viser's page, and its query where another web site may have led to the page around it."""
_STYLE = Path(__file__).parent / "page.css"
_STANDARD = {"panel": "viser"}


class Shell:
    """Builds the page; ``title`` is that of the browsers' tabs."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._clients: list[Client] = []

    def __call__(self, scope: Scope) -> None:
        """Build the page for a browser, within its NiceGUI client."""
        visit: Visit = scope["state"]["visit"]
        client = ui.context.client
        self._clients.append(client)
        client.on_delete(lambda: self._clients.remove(client))
        ui.page_title(self._title)
        ui.add_css(_STYLE)
        ui.add_head_html(f'<script src="{scope["root_path"]}{PARTS}rv.js"></script>')
        if visit.is_foreign:
            ui.add_body_html(f'<i hidden id="rv-{FOREIGN}"></i>')
        query = parse_qs(scope["query_string"].decode("latin-1"))
        layout = read_layout(query.get(LAYOUT, [""])[0])
        Workspace(layout, _STANDARD, visit.is_viewer)
        Timeline(visit.is_viewer).classes("w-full")

    def name(self, title: str) -> None:
        """Set another title, in all browsers; from any thread."""
        page_loop().call_soon_threadsafe(self._name, title)

    def _name(self, title: str) -> None:
        self._title = title
        for client in self._clients:
            with client:
                ui.page_title(title)
