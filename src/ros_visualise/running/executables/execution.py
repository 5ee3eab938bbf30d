"""A run of a graph in a process of its own, on a middleware's graph."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from ros_visualise.core.errors import OpenError
from ros_visualise.core.params import Parameters, update
from ros_visualise.core.rate import Clock, WallClock
from ros_visualise.data import Image
from ros_visualise.graph import Graph, M
from ros_visualise.running.executables.options import (
    choose_image_transport,
    choose_jpeg_quality,
    choose_view,
    number,
)
from ros_visualise.running.interruptible import begin, is_done
from ros_visualise.runtime.bridge.clock import ClockPublisher, advertise_clock
from ros_visualise.runtime.bridge.process import Process
from ros_visualise.runtime.middleware import Handle, Host, Transport
from ros_visualise.runtime.playing import PlayingParams, playing_params
from ros_visualise.runtime.saving import load, of_node, save_anew
from ros_visualise.sources.calibration import locate
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import View, ViewOptions, open_view
from ros_visualise.vision.compression import JPEG_QUALITY

log = logging.getLogger(__name__)

Conduct = Callable[[Host, Transport, Process], AbstractContextManager[None]]
"""Surrounds the running of a process."""

_SPIN_S = 0.1
_LOOK_S = 0.05
_GATHER_S = 5.0  # for subscribers that were there before a source that plays as fast as possible

T = TypeVar("T")


def announce_time(host: Host, transport: Transport) -> None:
    """Advertise ``/clock``, unless ``~clock`` is false, before a source that may open slowly."""
    if host.option("clock", True):
        advertise_clock(transport)


@contextmanager
def publish_time(
    host: Host,
    transport: Transport,
    process: Process,
    now_ns: Callable[[Playback], int] = Playback.stamp_ns,
) -> Iterator[None]:
    """Publish the time of a source that sets the clock, unless ``~clock`` is false."""
    playback = process.runtime.playback
    makes_time = process.runtime.graph.makes_time and host.option("clock", True)
    if playback is None or not makes_time:
        yield
    else:
        with closing(ClockPublisher(transport, lambda: now_ns(playback))):
            yield


def run_graph(
    host: Host,
    transport: Transport,
    graph: Graph,
    namespaces: Mapping[str, str],
    options: Iterable[str] = (),
    conduct: Conduct = publish_time,
) -> int:
    """Run a graph until it ends; the exit status.

    Args:
        host: begins and ends this process.
        transport: joins the graph to others.
        graph: its topics are relative to the namespace.
        namespaces: node name -> where its parameters are below this process's private namespace.
        options: private parameters that may stand beside those of the nodes.
        conduct: surrounds its running.
    """
    if graph.makes_time:
        announce_time(host, transport)
    stays = bool(host.option("stay", False))
    with running(host, transport, graph, namespaces, options, conduct, stays) as run:
        while not run.is_over:
            run.spin(_SPIN_S)
    return int(run.process.failed)


class Run:
    """A graph that runs in this process, and its view.

    Args:
        host: begins and ends this process.
        process: the graph.
        view: looks at it.
        stays: go on at the end of the source, unless something has failed.
    """

    def __init__(self, host: Host, process: Process, view: View, stays: bool) -> None:
        self.process = process
        self._host, self._view, self._stays = host, view, stays

    @property
    def is_over(self) -> bool:
        """True if the graph, the view or this process has ended."""
        runtime = self.process.runtime
        if self._host.is_over() or self._view.closed:
            return True
        return runtime.wait(0) and (runtime.failed or not self._stays)

    def spin(self, timeout_s: float) -> None:
        """Serve the view and the graph for this time."""
        self._view.spin(timeout_s)
        self.process.follow()


@contextmanager
def running(
    host: Host,
    transport: Transport,
    graph: Graph,
    namespaces: Mapping[str, str],
    options: Iterable[str],
    conduct: Conduct,
    stays: bool,
    active: bool = True,
) -> Iterator[Run]:
    """A graph with its view and services, until the end of the block.

    Args:
        host, transport, graph, namespaces, options, conduct: as of `run_graph`.
        stays: as of `Run`.
        active: as of `Process.start`.

    Raises:
        RosVisualiseError: the graph cannot be opened as the options ask for it.
        KeyboardInterrupt: this process has to end meanwhile.
    """
    name, shown = choose_view(host, "none")
    with closing(_open_view(name, shown)) as view:
        graph = _configured(host, transport, graph, namespaces, options)
        playback = _playback(host, transport, graph, stays or view.stays)
        takes_images = Image in graph.inputs.values()
        compressed = takes_images and choose_image_transport(host)
        makes_images = bool(graph.topics_of(Image))
        quality = choose_jpeg_quality(host) if makes_images else JPEG_QUALITY
        made = partial(Process, transport, graph, playback, namespaces, compressed, quality)
        process = opened(host, made)
        try:
            view.open(process.runtime)
            with conduct(host, transport, process):
                _await_subscribers(host, process)
                process.start(active)
                with closing(offer_saving(transport, lambda: process.parameters, shown.record_dir)):
                    yield Run(host, process, view, stays)
        finally:
            view.close()
            process.stop()


def _await_subscribers(host: Host, process: Process) -> None:
    """Give existing subscribers time to connect."""
    end_s = time.monotonic() + _GATHER_S
    while not host.is_over() and (missing := process.unconnected()):
        if time.monotonic() > end_s:
            log.warning("not all subscribers of %s connected; starting anyway", ", ".join(missing))
            return
        time.sleep(_LOOK_S)


def opened(host: Host, open_it: Callable[[], T]) -> T:
    """The result of a call that may take long, such as opening a simulation.

    Raises:
        KeyboardInterrupt: this process has to end meanwhile; the call is left alone.
    """
    opening = begin(open_it)
    while not is_done(opening):
        if host.is_over():
            raise KeyboardInterrupt
    return opening.result()


def _configured(
    host: Host,
    transport: Transport,
    graph: Graph,
    namespaces: Mapping[str, str],
    options: Iterable[str],
) -> Graph:
    """The graph with the parameters of launch files and of the command line."""
    graph = _extended(host, graph, namespaces)
    source = graph.source
    path = str(host.option("params", "none"))
    loaded = {} if path == "none" else load(Path(host.find_file(path)))

    def configured(member: M) -> M:
        kind = playing_params(source.type) if member is source else type(member.params)
        values = host.starting_values(kind, namespaces[member.name], options)
        values |= of_node(loaded, f"{transport.resolve('~')}/{namespaces[member.name]}")
        values = _without_none(values, kind())
        if hasattr(kind, "camera_info_url"):
            url = str(values.get("camera_info_url", ""))
            values["camera_info_url"] = locate(url, transport.resolve("~"))
        for name, value in values.items():
            if isinstance(value, str):
                values[name] = host.find_file(value)
        return replace(member, params=update(kind(), values))

    return graph.changed(configured)


def _without_none(values: Mapping[str, Any], defaults: object) -> dict[str, Any]:
    """The values, without ``none`` for a text that is empty by default, as in launch files."""
    return {
        name: value
        for name, value in values.items()
        if not (value == "none" and getattr(defaults, name, None) == "")
    }


def _extended(host: Host, graph: Graph, namespaces: Mapping[str, str]) -> Graph:
    """The graph with the parameters that depend on one of them, such as the device."""
    source = graph.source
    if source is None or source.type.extend is None:
        return graph
    decisive, _ = source.type.extend
    name = f"{namespaces[source.name]}/{decisive}".lstrip("/")
    value = host.option(name, getattr(source.params, decisive))
    return graph.configured({source.name: {decisive: value}})


def _playback(host: Host, transport: Transport, graph: Graph, stays: bool) -> Playback | None:
    """The playback of the source; with a view or with inputs, it stays at its end."""
    if graph.source is None:
        return None
    source, params = graph.source.type, graph.source.params
    duration_s = number(host, "duration")
    is_played = isinstance(params, PlayingParams)
    return Playback(
        rate=params.rate if is_played else 1.0,
        loop=is_played and params.loop,
        start_s=number(host, "start"),
        duration_s=duration_s or None,
        hold=(stays or bool(source.inputs)) and not duration_s,
        live_stamps=not source.makes_time,
        clock=_clock(host, transport, source.makes_time),
    )


def _clock(host: Host, transport: Transport, makes_time: bool) -> Clock:
    """The clock of a source: wall time if the source sets the graph's time, else that time."""
    if makes_time and host.option("clock", True):
        return WallClock()
    clock = transport.clock()
    while makes_time and not (clock.now_ns() or host.is_over()):
        time.sleep(_SPIN_S)  # it would begin at zero
    return clock


def offer_saving(
    transport: Transport, parameters: Callable[[], Mapping[str, Parameters[Any]]], folder: Path
) -> Handle:
    """The service ``~save_parameters``, which answers with the name of its file.

    Args:
        transport: what it is offered on.
        parameters: gives what there is to save then.
        folder: of the files.
    """
    return transport.offer("~save_parameters", lambda: str(save_anew(parameters(), folder)))


def _open_view(name: str, options: ViewOptions) -> View:
    """The view of ``~view``; none if it cannot be opened, as without a screen."""
    try:
        return open_view(name, options)
    except OpenError as error:
        log.warning("%s unavailable; continuing without: %s", name, error)
        return open_view("none", options)
