"""The executables, each by its name, on any host."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial

from ros_visualise.core.errors import RosVisualiseError, UsageError
from ros_visualise.core.limits import DEFAULT_MEMORY, parse_memory, set_max_memory
from ros_visualise.core.supervision import status_of
from ros_visualise.graph import IMAGE_NODES
from ros_visualise.graph.pipelines import alone, build
from ros_visualise.nodes import NodeType, SourceType, find
from ros_visualise.running.executables.execution import offer_saving, run_graph
from ros_visualise.running.executables.managed import run_managed
from ros_visualise.running.executables.options import (
    OPTIONS,
    choose_image_transport,
    choose_view,
    switch,
)
from ros_visualise.running.executables.player import run_player
from ros_visualise.runtime.middleware import Host, Transport
from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.runtime.saving import live_parameters
from ros_visualise.ui import open_view, watch

log = logging.getLogger(__name__)

Work = Callable[[Host, Transport], int]
"""The work of an executable until it ends; gives its exit status."""


def run(name: str, host: Host) -> None:
    """Run an executable by its name; ``node`` runs what its argument names.

    Raises:
        UsageError: no node is given, or more than one.
        OpenError: it cannot be loaded.
    """
    if name == "node":
        name = _given(host.arguments())
    if name in _OTHERS:
        _run(name, host, _OTHERS[name])
    else:
        declared = find(name)  # fails before it takes the name of one that runs
        _run(declared.name, host, _alone(declared))


def _run(name: str, host: Host, work: Work) -> None:
    transport = host.begin(name)
    try:
        set_max_memory(parse_memory(str(host.option("max_memory", DEFAULT_MEMORY))))
        status = work(host, transport)
    except RosVisualiseError as error:
        log.critical("%s", error)
        status = error.exit_status
    except KeyboardInterrupt:  # asked to end while it was opening something
        status = 0
    finally:
        host.end()
    sys.exit(status_of(status))


def _alone(declared: NodeType | SourceType) -> Work:
    graph, namespaces = alone(declared), {declared.name: ""}
    return lambda host, transport: run_graph(host, transport, graph, namespaces, OPTIONS)


def _given(arguments: Sequence[str]) -> str:
    if len(arguments) != 1:
        raise UsageError("give one node: its name, or FILE.py:NAME")
    return arguments[0]


def _run_pipeline(host: Host, transport: Transport) -> int:
    """Run several nodes in one process; between them images pass by reference.

    With ``~managed`` it does nothing before a manager of ROS 2's managed nodes configures it.
    """
    names = str(host.option("nodes", " ".join(IMAGE_NODES))).split()
    source = str(host.option("source", "none"))
    graph = build(None if source == "none" else source, "/image_raw", through=names)
    namespaces = {node.name: node.name for node in graph.members}
    if switch(host, "managed", False):
        return run_managed(host, transport, graph, namespaces)
    return run_graph(host, transport, graph, namespaces)


def _run_viewer(host: Host, transport: Transport) -> int:
    """Show the topics and parameters of other nodes on the graph."""
    name, options = choose_view(host, "web")
    runtime = RemoteRuntime(transport, choose_image_transport(host))
    parameters = partial(live_parameters, runtime)
    try:
        with closing(offer_saving(transport, parameters, options.record_dir)):
            watch(
                runtime, lambda: open_view(name, options), host.is_over, reopens=name == "windows"
            )
    finally:
        runtime.close()
    return 0


_OTHERS: dict[str, Work] = {"pipeline": _run_pipeline, "player": run_player, "viewer": _run_viewer}
