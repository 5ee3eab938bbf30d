"""Joining a network of other machines, and sharing with it what runs here."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Protocol

from ros_visualise.core.errors import OpenError
from ros_visualise.graph import Graph
from ros_visualise.running.options import NetworkOptions
from ros_visualise.runtime.bridge.process import Process
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.playing import playing_params
from ros_visualise.sources.playback import Playback

if TYPE_CHECKING:
    from ros_visualise.runtime.middleware import Transport

_INSTALL = "pip install 'ros_visualise[zenoh]' (in a clone: pip install '.[zenoh]')"


def join(options: NetworkOptions, name: str, wait_s: float = math.inf) -> Transport | None:
    """The transport that options ask for; None without one. Waits for the peer.

    Args:
        options: addresses, and the node's name.
        name: the node's default name.
        wait_s: how long to wait for a peer.

    Raises:
        Unreachable: no peer by then.
        UsageError: an address is invalid.
        OpenError: it cannot be listened on, or Zenoh is not installed.
    """
    if not (options.connect or options.listen):
        return None
    try:
        session = import_module("ros_visualise.runtime.zenoh.session")
        transport = import_module("ros_visualise.runtime.zenoh.transport")
    except ImportError as error:
        raise OpenError(f"--connect and --listen need Zenoh: {_INSTALL} ({error})") from None
    endpoints = session.Endpoints(tuple(options.connect), tuple(options.listen), wait_s)
    made: Transport = transport.ZenohTransport(options.node_name or name, endpoints)
    return made


class Running(Protocol):
    """A graph that runs in this process."""

    runtime: LocalRuntime

    def start(self) -> None:
        """Run it."""

    def follow(self) -> None:
        """Serve the graph now and then."""

    def stop(self) -> None:
        """End it."""

    def leave(self) -> None:
        """Leave its topics, after `stop`."""

    @property
    def failed(self) -> bool:
        """True if data was lost."""


class Alone:
    """A graph that no other machine sees."""

    def __init__(self, graph: Graph, playback: Playback) -> None:
        self.runtime = LocalRuntime(graph, playback)
        self.start, self.stop = self.runtime.start, self.runtime.stop

    def follow(self) -> None:
        """Nothing to serve."""

    def leave(self) -> None:
        """No topics to leave."""

    @property
    def failed(self) -> bool:
        """True if data was lost."""
        return self.runtime.failed or self.runtime.report().is_incomplete


def running(graph: Graph, playback: Playback, transport: Transport | None) -> Running:
    """A graph that runs here, and is shared where a transport is given."""
    if transport is None:
        return Alone(graph, playback)
    names = {member.name: member.name for member in graph.members}
    return Process(transport, _played(graph, playback), playback, names)


def _played(graph: Graph, playback: Playback) -> Graph:
    """The graph with the playback of its source among the source's parameters."""
    source = graph.source
    if source is None:
        return graph
    state, kind = playback.state, playing_params(source.type)
    playing = {"rate": state.rate, "loop": state.loop, "paused": not state.playing}
    known = {name: value for name, value in playing.items() if hasattr(kind, name)}
    return replace(graph, source=replace(source, params=kind(**vars(source.params), **known)))
