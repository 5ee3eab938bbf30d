"""The page of one graph: the main panel, the windows, and the threads behind them."""

from __future__ import annotations

import logging
from functools import partial

import viser

from ros_visualise.graph import Member
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.report import RunReport
from ros_visualise.ui.live.newest import Newest
from ros_visualise.ui.live.space.hub import SpaceHub
from ros_visualise.ui.live.topics import figures
from ros_visualise.ui.page.controls import PresetChoice
from ros_visualise.ui.page.files import Opener, PageFiles
from ros_visualise.ui.page.graph import graph_picture
from ros_visualise.ui.page.layout import WindowSwitches
from ros_visualise.ui.page.notice import Notice, Warnings
from ros_visualise.ui.page.playback_range import PlaybackRange
from ros_visualise.ui.page.recorder import RecordingPanel, SavePanel
from ros_visualise.ui.page.robot import Driving, RobotStatus
from ros_visualise.ui.page.settings import PageSettings, SettingsMemory
from ros_visualise.ui.page.style import IMAGES_ALONE, STYLE
from ros_visualise.ui.page.tools import ActionPanels
from ros_visualise.ui.page.tree import tree_picture
from ros_visualise.ui.page.windows import Window, has_window
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.shown import robot_status

_PERIOD_S, _DRIVE_PERIOD_S = 0.2, 0.05
_WINDOW_S = 2.0


class PageContent:
    """Builds the page and keeps it up to date; shows warnings of the log too.

    When the graph changes, windows of unchanged nodes stay as they are.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        figures: Newest,
        space: SpaceHub,
        runtime: Runtime,
        files: PageFiles,
        memory: SettingsMemory,
    ) -> None:
        self._server, self._runtime, self._files = server, runtime, files
        self._memory = memory
        self._figures = figures
        self._graph = runtime.graph
        self._ticks = 0
        gui = server.gui
        gui.add_html(STYLE)
        self._notice = Notice(gui)
        self._worker = Worker(self._notice.say, self._refresh, _PERIOD_S)
        self._driver = Worker(self._notice.say, lambda: self._driving.refresh(), _DRIVE_PERIOD_S)
        self._actors: dict[str, Worker] = {}  # node -> who does its actions
        assert space.scene is not None
        self._space, self._scene = space, space.scene
        robot = robot_status(self._graph)[0]
        self._robot_name = None if robot is None else robot.name
        self._windows: list[Window] = []
        self._windows = self._make_windows()
        self._add_main_panel(gui)
        self._follow_windows()
        self._switches.begin()
        self._settings.take_in()
        self._warnings = Warnings(self._notice.say)
        logging.getLogger("ros_visualise").addHandler(self._warnings)
        self._worker.start()
        self._driver.start()

    @property
    def graph_picture(self) -> str:
        """An SVG of the nodes and topics."""
        return graph_picture(self._graph)

    @property
    def frames_picture(self) -> str:
        """An SVG of the tree of frames."""
        return tree_picture(self._scene.frames.links.all())

    def close(self, timeout_s: float) -> None:
        """End the threads, each within the given time."""
        self._memory.remember(self._settings.arrangement)
        self._recorder.close()
        logging.getLogger("ros_visualise").removeHandler(self._warnings)
        self._worker.close(timeout_s)
        self._driver.close(timeout_s)  # which makes the actors
        for actor in list(self._actors.values()):
            actor.close(timeout_s)
        for window in self._windows:
            window.close()
        self._tools.rest()

    def _add_main_panel(self, gui: viser.GuiApi) -> None:
        gui.add_html(IMAGES_ALONE)
        self._settings = PageSettings(gui, self._worker, self._space, self._memory)
        playback = self._runtime.playback
        self._range: PlaybackRange | None = None
        if playback is not None and not self._graph.live:
            self._range = PlaybackRange(gui, playback, self._worker)
        self._preset = PresetChoice(gui, self._runtime, self._worker)
        self._opener = None
        if self._files.chooser is not None:
            self._opener = Opener(gui, self._files, self._worker)
        self._tools = ActionPanels(gui, self._runtime, self._worker, self._act)
        self._tools.follow(self._graph)
        robot = gui.add_folder("Robot")
        self._robot = RobotStatus(gui, robot, self._runtime, self._worker, self._act)
        self._driving = Driving(gui, robot, self._runtime, self._driver)
        self._windows_folder = gui.add_folder("Windows")
        self._switches = WindowSwitches(gui, self._windows_folder, self._worker)
        with gui.add_folder("Recording"):
            self._recorder = RecordingPanel(gui, self._runtime, self._worker, self._files)
            SavePanel(gui, self._runtime, self._worker, self._files.folder, self._settings)

    def _make_windows(self) -> list[Window]:
        """A window for each node with something to show; unchanged ones are kept."""
        there = {window.name: window for window in self._windows}
        return [
            self._make_window(n, there.get(n.name)) for n in self._graph.members if has_window(n)
        ]

    def _make_window(self, node: Member, there: Window | None) -> Window:
        if there is not None and there.shows(node):
            return there
        gui = self._server.gui
        act = None if node.name == self._robot_name else self._act
        return Window(gui, self._runtime, node, self._worker, act)

    def _act(self, node: str, action: str) -> None:
        """Do an action on its node's thread, so that driving and other nodes need not wait."""
        self._driver.post(object(), partial(self._begin_action, node, action))

    def _begin_action(self, node: str, action: str) -> None:
        self._driving.make_way(node)
        if node not in self._actors:
            self._actors[node] = Worker(self._notice.say, lambda: None, _PERIOD_S)
            self._actors[node].start()
        self._actors[node].post(object(), partial(self._runtime.act, node, action))

    def _end_actors(self) -> None:
        """End the threads of nodes that have left the graph."""
        there = {node.name for node in self._runtime.graph.members}
        for name in self._actors.keys() - there:
            self._actors.pop(name).close(0)

    def _follow_windows(self) -> None:
        self._switches.follow(self._windows, False)
        self._windows_folder.visible = bool(self._windows)

    def _follow(self) -> None:
        """Show the present graph."""
        self._graph, before = self._runtime.graph, self._windows
        self._windows = self._make_windows()
        for window in before:
            if window not in self._windows:
                window.remove()
        self._tools.follow(self._graph)
        self._recorder.follow(self._graph)
        self._driver.post("actors", self._end_actors)
        self._follow_windows()
        self._settings.take_in()
        if before != self._windows:
            self._switches.show()

    def _refresh(self) -> None:
        if self._runtime.graph is not self._graph:
            self._follow()
        self._notice.refresh()
        self._recorder.refresh()
        if not self._is_watched():
            for window in self._windows:
                window.rest()
            self._tools.rest()
            return
        for window in self._windows:
            window.refresh()
        self._tools.refresh()
        if self._range is not None:
            self._range.refresh()
        self._preset.refresh()
        self._settings.refresh()
        self._robot.refresh()
        self._ticks += 1
        if self._ticks % 5 == 1:
            if self._opener is not None:
                self._opener.refresh()
            self._show_report(self._runtime.report(_WINDOW_S))

    def _show_report(self, report: RunReport) -> None:
        if self._runtime.graph is self._graph:  # else the report may be of the next one
            self._figures.put(figures(self._graph, report))

    def _is_watched(self) -> bool:
        return bool(self._server.get_clients()) or self._figures.is_watched

    def _unthrottled(self) -> bool:
        playback = self._runtime.playback
        return playback is not None and playback.state.rate == 0
