"""The page: a running graph in the browser."""

from __future__ import annotations

import logging
import socket
import threading
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from ros_visualise.core.errors import RosVisualiseError, did_you_mean
from ros_visualise.core.printing import print_status
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui import Value, ViewOptions
from ros_visualise.ui.live.files import FilesHub
from ros_visualise.ui.live.map import MapHub
from ros_visualise.ui.live.marks import Marks
from ros_visualise.ui.live.nodes import NodesHub
from ros_visualise.ui.live.notes import NotesHub
from ros_visualise.ui.live.notices import Notices
from ros_visualise.ui.live.publish import PublishHub
from ros_visualise.ui.live.robot import RobotHub
from ros_visualise.ui.live.settings import by_name
from ros_visualise.ui.live.texts import LiveTexts, RecordedTexts, Texts
from ros_visualise.ui.live.thumbnails import Thumbnails
from ros_visualise.ui.live.ticks import ticks
from ros_visualise.ui.page.browser import Browser
from ros_visualise.ui.page.graph import graph_picture
from ros_visualise.ui.page.server import PageServer, url
from ros_visualise.ui.page.tree import tree_picture
from ros_visualise.ui.scene.urdf import read_urdf
from ros_visualise.ui.server.access import AccessRules, access_rules
from ros_visualise.ui.server.answers import Answer, BrowserQuery, Refusal, as_json
from ros_visualise.ui.server.files import PageFiles
from ros_visualise.ui.server.host import page_loop
from ros_visualise.ui.server.pool import Pool
from ros_visualise.ui.server.tiles import open_tiles
from ros_visualise.ui.shell.workspace import LAYOUT, read_layout

log = logging.getLogger(__name__)

_ANSWERING = 8  # threads: some read a recording
_QUERIES = ("recorded", "graph", "frames", "ticks", "thumbnail", "texts")


class Page:
    """Serves the page from the start.

    Attributes:
        url: its address for a browser on this machine.
        view_url: the read-only address; empty without tokens.

    Raises:
        OpenError: the port is in use, the address is not one of this machine, or the robot's
            description or the map's tiles cannot be read.
        UsageError: as `access_rules` and `open_tiles`.
    """

    stays = True

    def __init__(self, options: ViewOptions) -> None:
        host, port = options.host, options.port
        rules = access_rules(host, options.origins, options.token)
        if rules.addresses and not options.token:
            log.warning("no token: anyone who can reach %s can use the page", host)
        urdf = "" if options.urdf is None else read_urdf(options.urdf)
        template, tiles = open_tiles(options.tiles)
        self._files = PageFiles(options.record_dir, options.chooser)
        self._notices, loop = Notices(), page_loop()
        robot = RobotHub(loop, self._notices.note)
        self._nodes = NodesHub(loop, self._notices, robot.act, options.arrangement)
        files = FilesHub(loop, self._notices.note, self._files, self._settings)
        self._notes = NotesHub(loop, self._notices.note)
        publish = PublishHub(loop, self._notices.note, options.control)
        self._querys = Pool("page answers", _ANSWERING)
        self.url = url(host, port, rules.token)
        self.view_url = url(host, port, rules.view_token) if options.token else ""
        self._addresses = _lines(host, port, rules)
        self._server = PageServer(
            host,
            port,
            options.title,
            rules,
            options.flag,
            self._answer,
            self._files.receive,
            more=[robot, self._nodes, files, publish, self._notes, MapHub(template)],
        )
        self._server.space.urdf, self._server.tiles = urdf, tiles
        self._server.space.apply(by_name(options.arrangement))
        self._nodes.restored = self._restore_scene
        self._server.offered.wanted = read_layout(str(options.arrangement.get(LAYOUT, "")))
        self._browser = Browser(self.url, lambda: not self.awaited) if options.browser else None
        self._runtime: Runtime | None = None
        self._thumbnails: Thumbnails | None = None
        self._texts: Texts | None = None
        self._ended = threading.Event()

    @property
    def closed(self) -> bool:
        """Always False: a closed browser may be opened again."""
        return False

    @property
    def awaited(self) -> bool:
        """True until a browser shows it."""
        return not (self._server.offered.is_seen or self._server.images.is_shown)

    def _restore_scene(self, settings: Mapping[str, Value]) -> None:
        """Apply settings of the 3D view in an address of the last release."""
        of_scene = {p: v for p, v in settings.items() if p.startswith("3d/") or p == "view"}
        if of_scene:
            self._server.space.apply(of_scene)

    def _settings(self) -> dict[str, Value]:
        """Settings that a layout file holds beside the layout."""
        return self._nodes.saved | self._server.space.arrangement

    def open(self, runtime: Runtime) -> None:
        """Show this graph, in place of the one before."""
        if self._runtime is not None:
            self._server.show(None)
            self._show(runtime)
            return
        self._show(runtime)
        for line in self._addresses:
            print_status(line)
        if self._browser is not None:
            self._browser.open()

    def _show(self, runtime: Runtime) -> None:
        self._runtime = runtime
        for before in (self._thumbnails, self._texts):
            if before is not None:
                before.close()
        self._thumbnails = Thumbnails(runtime)
        marks = self._server.clock.marks = self._marks()
        self._notes.follow(marks)
        self._server.show(runtime)
        rewinder = self._server.rewinder
        self._texts = RecordedTexts(runtime) if rewinder is None else LiveTexts(rewinder)
        if self._files.title:
            self._server.offered.title = self._files.title

    def _marks(self) -> Marks:
        """The marks of the file that is shown."""
        current = None if self._files.chooser is None else self._files.chooser.current
        try:
            return Marks(current if isinstance(current, Path) else None)
        except RosVisualiseError as error:
            log.warning("%s; new marks will not be saved", error)
            return Marks()

    async def _answer(self, query: BrowserQuery, is_viewer: bool) -> Answer | None:
        asked = query.text("ask")
        if asked == "recorded":
            return await self._files.answer(query)
        if "ask" not in query:
            return None
        shown, scene = self._runtime, self._server.space.scene
        if shown is None or scene is None:  # there is a server already
            raise Refusal("not ready yet; try again in a moment", 503)
        if asked == "graph":
            return as_json({"svg": graph_picture(shown.graph)})
        if asked == "frames":
            return as_json({"svg": tree_picture(scene.frames.links.all())})
        if asked == "ticks":
            return as_json(await self._querys.do(lambda: ticks(shown)))
        if asked == "thumbnail" and self._thumbnails is not None:
            at_s = query.seconds("at")
            jpeg = await self._querys.do(partial(self._thumbnails.at, at_s))
            return Answer(jpeg, "image/jpeg")
        if asked == "texts" and self._texts is not None:
            words = query.text("words")
            return as_json(await self._querys.do(partial(self._texts.find, words)))
        raise Refusal(f"unknown query{did_you_mean(asked, _QUERIES)}", 404)

    def spin(self, timeout_s: float) -> None:
        """Wait: the page has no work for the main thread."""
        self._ended.wait(timeout_s)

    def close(self) -> None:
        """Close the page; safe to call twice."""
        if self._ended.is_set():
            return
        self._ended.set()
        self._server.close()
        self._querys.close()
        self._files.close()
        for shown in (self._thumbnails, self._texts):
            if shown is not None:
                shown.close()
        if self._browser is not None:
            self._browser.close()


def _lines(host: str, port: int, rules: AccessRules) -> list[str]:
    """The addresses, printed and never logged: they hold tokens."""
    names = [host] if not rules.addresses else [host, socket.gethostname()]
    addresses = " or, from another machine, ".join(url(name, port, rules.token) for name in names)
    lines = [f"open {addresses} (Ctrl-C stops)"]
    if rules.view_token:
        addresses = " or, from another machine, ".join(
            url(name, port, rules.view_token) for name in names
        )
        lines.append(f"read-only: {addresses}")
    return lines
