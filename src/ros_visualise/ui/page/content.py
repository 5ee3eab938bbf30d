"""Figures and pictures of one graph."""

from __future__ import annotations

from collections.abc import Callable

from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.newest import Newest
from ros_visualise.ui.live.space.hub import SpaceHub
from ros_visualise.ui.live.topics import figures
from ros_visualise.ui.page.graph import graph_picture
from ros_visualise.ui.page.tree import tree_picture
from ros_visualise.ui.worker import PageWorker

_PERIOD_S = 1.0
_WINDOW_S = 2.0


class PageContent:
    """Keeps the figures of the topics up to date while browsers show them."""

    def __init__(
        self, figures: Newest, space: SpaceHub, runtime: Runtime, say: Callable[[str], None]
    ) -> None:
        assert space.scene is not None
        self._figures, self._scene, self._runtime = figures, space.scene, runtime
        self._worker = PageWorker(say, self._refresh, _PERIOD_S)
        self._worker.start()

    @property
    def graph_picture(self) -> str:
        """An SVG of the nodes and topics."""
        return graph_picture(self._runtime.graph)

    @property
    def frames_picture(self) -> str:
        """An SVG of the tree of frames."""
        return tree_picture(self._scene.frames.links.all())

    def close(self, timeout_s: float) -> None:
        """End the thread, within the given time."""
        self._worker.close(timeout_s)

    def _refresh(self) -> None:
        if self._figures.is_watched:
            graph = self._runtime.graph
            report = self._runtime.report(_WINDOW_S)
            if self._runtime.graph is graph:  # else the report may be of the next one
                self._figures.put(figures(graph, report))
