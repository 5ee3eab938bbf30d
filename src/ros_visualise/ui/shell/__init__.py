"""The shell of the page: what surrounds the panels, built for each browser."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import parse_qs

from nicegui import Client, ui

from ros_visualise.ui.look import PAGES
from ros_visualise.ui.parts.edge import Edge
from ros_visualise.ui.parts.frame import Frame
from ros_visualise.ui.parts.timeline import Timeline
from ros_visualise.ui.server.gate import Scope, Visit
from ros_visualise.ui.server.host import page_loop
from ros_visualise.ui.shell.panels import PANELS

VISER = "/viser"
FOREIGN = "foreign"
"""Path of viser's page, and its query where another web site may have led to the page around it."""
OPEN = "panels"
"""The query of an address with the names of open panels."""
_STYLE = Path(__file__).parent / "page.css"


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
        query = parse_qs(scope["query_string"].decode("latin-1"))
        with ui.element("div").classes("rv-main"):
            Frame(scope["root_path"] + VISER + (f"?{FOREIGN}" if visit.is_foreign else ""))
            Side(query.get(OPEN, [""])[0].split(","))
        Timeline(visit.is_viewer).classes("w-full")

    def name(self, title: str) -> None:
        """Set another title, in all browsers; from any thread."""
        page_loop().call_soon_threadsafe(self._name, title)

    def _name(self, title: str) -> None:
        self._title = title
        for client in self._clients:
            with client:
                ui.page_title(title)


class Side:
    """The panels of one browser, and a button for each; those that are open are in its address."""

    def __init__(self, opened: list[str]) -> None:
        self._opened: dict[str, ui.element] = {}
        self._edge = Edge()
        self._side = ui.element("div").classes("rv-side")
        with ui.element("div").classes("rv-rail"):
            for name in PANELS.names():
                panel = PANELS.find(name)
                button = ui.button(icon=panel.icon, on_click=lambda name=name: self._toggle(name))
                button.props(f'flat dense aria-label="{panel.title}" title="{panel.title}"')
            for page, icon in list(PAGES.items())[1:]:
                link = ui.button(icon=icon).props(f'flat dense href="?look={page}" target="_blank"')
                link.props(f'aria-label="{page.capitalize()}" title="{page.capitalize()}"')
        for name in PANELS.names():
            if name in opened:
                self._open(name)
        self._fit()

    def _toggle(self, name: str) -> None:
        if name in self._opened:
            self._opened.pop(name).delete()
        else:
            self._open(name)
        self._fit()
        query = f"?{OPEN}={','.join(self._opened)}" if self._opened else ""
        place = f"location.pathname + '{query}' + location.hash"
        self._side.client.run_javascript(f"history.replaceState(null, '', {place})")

    def _open(self, name: str) -> None:
        panel = PANELS.find(name)
        with self._side, ui.element("section").classes("rv-panel") as self._opened[name]:
            with ui.element("div").classes("rv-panel-head"):
                ui.label(panel.title)
                close = ui.button(icon="close", on_click=lambda: self._toggle(name))
                close.props(f'flat dense size=sm aria-label="Close {panel.title}"')
            panel()

    def _fit(self) -> None:
        for element in (self._edge, self._side):
            element.set_visibility(bool(self._opened))
