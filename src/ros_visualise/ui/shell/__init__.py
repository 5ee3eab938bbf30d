"""The shell of the page: what surrounds the panels, built for each browser."""

from __future__ import annotations

from nicegui import Client, ui

from ros_visualise.ui.parts.timeline import Timeline
from ros_visualise.ui.server.gate import Scope, Visit
from ros_visualise.ui.server.host import page_loop

VISER = "/viser"
FOREIGN = "foreign"
"""Path of viser's page, and its query where another web site may have led to the page around it."""
_STYLE = """
.nicegui-content { padding: 0; gap: 0; height: 100dvh; flex-wrap: nowrap; }
.rv-viser { width: 100%; flex: 1; min-height: 0; border: 0; display: block; }
.rv-timeline { width: 100%; display: flex; flex-wrap: wrap; align-items: center; gap: 0 .6em;
  padding: 1px .6em; border-top: 1px solid #8884; }
.rv-controls { display: flex; align-items: center; gap: .2em; }
.rv-controls :is(select) { background: transparent; color: inherit; border: 0; font-size: .85rem; }
.rv-controls option { background: #222; }
.rv-topic { max-width: 10em; }
.rv-clock { font-variant-numeric: tabular-nums; margin-left: .3em; white-space: nowrap; }
.rv-bar { flex: 1 1 12em; height: 38px; cursor: pointer; touch-action: none; user-select: none; }
@media (max-width: 700px) { .rv-bar { order: -1; flex-basis: 100%; } }
.rv-bar canvas { width: 100%; height: 100%; display: block; }
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
        Timeline(visit.is_viewer).classes("w-full")

    def name(self, title: str) -> None:
        """Set another title, in all browsers; from any thread."""
        page_loop().call_soon_threadsafe(self._name, title)

    def _name(self, title: str) -> None:
        self._title = title
        for client in self._clients:
            with client:
                ui.page_title(title)
