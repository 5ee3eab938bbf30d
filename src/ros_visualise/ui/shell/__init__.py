"""The shell of the page: what surrounds the panels, built for each browser."""

from __future__ import annotations

from nicegui import Client, ui

from ros_visualise.ui.server.gate import Scope, Visit
from ros_visualise.ui.server.host import page_loop

VISER = "/viser"
FOREIGN = "foreign"
"""Path of viser's page, and its query where another web site may have led to the page around it."""
_STYLE = """
.nicegui-content { padding: 0; gap: 0; }
.rv-viser { width: 100%; height: 100vh; border: 0; display: block; }
"""


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
        query = f"?{FOREIGN}" if visit.is_foreign else ""
        source = f"{scope['root_path']}{VISER}{query}"
        focus = "(event) => event.target.contentWindow.focus()"
        frame = ui.element("iframe").props(f'src="{source}" title="Graph"').classes("rv-viser")
        frame.on("load", js_handler=focus)

    def name(self, title: str) -> None:
        """Set another title, in all browsers; from any thread."""
        page_loop().call_soon_threadsafe(self._name, title)

    def _name(self, title: str) -> None:
        self._title = title
        for client in self._clients:
            with client:
                ui.page_title(title)
