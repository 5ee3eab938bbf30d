"""Showing a graph that others start, change and end."""

from __future__ import annotations

import time
from collections.abc import Callable

from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui import View

_SPIN_S = 0.1


def watch(
    runtime: Runtime, open_one: Callable[[], View], is_over: Callable[[], bool], reopens: bool
) -> None:
    """Show a graph until it is over or a person closes the view. To be called on the main thread.

    Args:
        runtime: its ``graph`` is another object as soon as it has changed.
        open_one: opens a view.
        is_over: whether to end.
        reopens: whether the view has to be reopened to follow a change; it is open only while there
            is a topic to show.

    Raises:
        OpenError: the view cannot be opened.
    """
    view: View | None = None
    shown: Graph | None = None
    try:
        while not is_over() and not (view is not None and view.closed):
            graph = runtime.graph
            if view is not None and reopens and shown is not graph:
                view.close()
                view = None
            if view is None and (graph.topics or not reopens):
                view, shown = open_one(), graph
                view.open(runtime)
            if view is None:
                time.sleep(_SPIN_S)
            else:
                view.spin(_SPIN_S)
    finally:
        if view is not None:
            view.close()
