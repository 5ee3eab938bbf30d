"""The work of the ROS executables, each by its name."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from ros_visualise.data import Image
from ros_visualise.errors import OpenError, RosVisualiseError, UsageError
from ros_visualise.graph import Graph, M, SourceNode
from ros_visualise.limits import DEFAULT_MEMORY, parse_memory, set_max_memory
from ros_visualise.nodes import NodeType, SourceType, choose_node, find
from ros_visualise.nodes.player import player
from ros_visualise.params import update
from ros_visualise.pipelines import IMAGE_NODES, alone, chain
from ros_visualise.rate import WallClock
from ros_visualise.runtime.ros1 import session
from ros_visualise.runtime.ros1.clock import ClockPublisher, ros_clock
from ros_visualise.runtime.ros1.playing import PlayingParams, playing_params
from ros_visualise.runtime.ros1.process import Process
from ros_visualise.runtime.ros1.reconfigure import starting_values
from ros_visualise.runtime.ros1.remote.runtime import RemoteRuntime
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.gaps import PlayedTime, played_time
from ros_visualise.sources.recordings.images import first_image
from ros_visualise.ui import View, ViewOptions, open_view
from ros_visualise.ui.watching import watch

log = logging.getLogger(__name__)

_SPIN_S = 0.1
_OPTIONS = (
    *("view", "host", "port", "allow_origin", "window", "record_dir"),
    *("image_transport", "start", "duration", "clock", "max_memory", "end_with_master"),
)
"""Private parameters that every executable reads once, beside those that its node declares."""
_NOT_PLAYED = ("/clock", "/rosout", "/rosout_agg")
_PATIENCE_S = 20.0


def run(name: str) -> None:
    """Run one of `_OTHERS`, a node of one's own, or the built-in node or source of this name.

    Raises:
        UsageError: no node of one's own is given, or more than one.
        OpenError: it cannot be loaded.
    """
    if name == "node":
        declared = _own(session.arguments())  # fails before it takes the name of one that runs
        _run(declared.name, lambda: _run_alone(declared))
    else:
        _run(name, _OTHERS.get(name, lambda: _run_alone(find(name))))


def _run(name: str, work: Callable[[], int]) -> None:
    session.begin(name)
    try:
        set_max_memory(parse_memory(str(session.option("max_memory", DEFAULT_MEMORY))))
        status = work()
    except RosVisualiseError as error:
        log.critical("%s", error)
        status = error.exit_status
    session.end("done")
    sys.exit(status)


def _run_alone(declared: NodeType | SourceType) -> int:
    return _run_graph(alone(declared), {declared.name: ""}, _OPTIONS)


def _own(given: Sequence[str]) -> NodeType:
    if len(given) != 1:
        raise UsageError("give a node of your own as FILE.py:NAME")
    return choose_node(given[0])


def _run_pipeline() -> int:
    """Run several nodes in one process; between them images pass by reference."""
    names = str(session.option("nodes", " ".join(IMAGE_NODES))).split()
    graph = chain([choose_node(name) for name in names], session.option("source", "") or None)
    namespaces = {node.name: node.name for node in graph.members}
    return _run_graph(graph, namespaces)


def _run_viewer() -> int:
    """Show what nodes elsewhere on the graph publish, and their parameters."""
    name, options = _view_options("web")
    runtime = RemoteRuntime(_wants_compressed())
    try:
        watch(
            runtime,
            lambda: open_view(name, options),
            session.is_over,
            reopens=name == "windows",
        )
    finally:
        runtime.close()
    return 0


def _run_player() -> int:
    """Play a recording onto the graph, with its time on /clock."""
    path = session.find_file(str(session.option("path", "")))
    if not path:
        raise OpenError("give the recording, _path:=FILE")
    recording = open_recording(path)
    topics = _named_in("topics", "all")
    declared = player(recording, topics, without=_NOT_PLAYED)
    outputs = {topic: topic for topic in declared.outputs}
    if image := _chosen_image(recording, declared):
        outputs[image] = "/image_raw"
    graph = Graph(SourceNode("player", declared, declared.params(), {}, outputs), ())
    options = (*_OPTIONS, "path", "topics", "image", "wait_for")
    awaited = _named_in("wait_for", "none")
    if "/image_raw" not in outputs.values():  # nobody is kept waiting for images that there are not
        awaited = [topic for topic in awaited if topic.removeprefix("/") != "image_raw"]
    conduct = partial(_conduct, played_time(recording, tuple(declared.outputs)), awaited)
    return _run_graph(graph, {"player": ""}, options, conduct)


def _named_in(option: str, default: str) -> list[str]:
    """What an option names, separated by spaces; nothing where it has its default."""
    named = str(session.option(option, default))
    return [] if named == default else named.split()


def _chosen_image(recording: Recording, declared: SourceType) -> str | None:
    """The recorded images that are played as those of a camera, on image_raw."""
    wanted = str(session.option("image", "none"))
    images = [topic for topic, kind in declared.outputs.items() if kind is Image]
    if wanted in images:
        return wanted
    if wanted in ("none", "first"):
        return first_image(recording, images) if wanted == "first" else None
    there = ", ".join(images) or "none in it"
    raise UsageError(f"image={wanted}: no such topic of images; there is {there}")


@contextmanager
def _conduct(played: PlayedTime, awaited: Sequence[str], process: Process) -> Iterator[None]:
    """Publish the recording's time, and begin when those who are to see it all are there."""
    with _publish_time(process, lambda playback: played.stamp_ns(playback.time_ns())):
        _wait_for_subscribers(process, awaited)
        yield


@contextmanager
def _publish_time(
    process: Process, now_ns: Callable[[Playback], int] = Playback.stamp_ns
) -> Iterator[None]:
    """Publish the time that a source makes, unless it was asked not to."""
    playback = process.runtime.playback
    makes_time = process.runtime.graph.makes_time and session.option("clock", True)
    if playback is None or not makes_time:
        yield
    else:
        with closing(ClockPublisher(lambda: now_ns(playback))):
            yield


def _wait_for_subscribers(process: Process, topics: Sequence[str]) -> None:
    end_s = time.monotonic() + _PATIENCE_S
    while not session.is_over() and not all(process.subscribers(topic) for topic in topics):
        if time.monotonic() > end_s:
            log.warning("nobody listens to %s: playing all the same", " and ".join(topics))
            return
        time.sleep(_SPIN_S)


def _run_graph(
    graph: Graph,
    namespaces: Mapping[str, str],
    options: Iterable[str] = (),
    conduct: Callable[[Process], AbstractContextManager[None]] = _publish_time,
) -> int:
    """Run a graph until it ends; ``conduct`` surrounds its running."""
    view = _open_view()
    try:
        graph = _configured(graph, namespaces, options)
        process = Process(graph, _playback(graph, view.stays), namespaces, _wants_compressed())
    except RosVisualiseError:
        view.close()
        raise
    try:
        view.open(process.runtime)
        with conduct(process):
            process.start()
            _spin(process, view)
    finally:
        view.close()
        process.stop()
    return int(process.runtime.failed)


def _spin(process: Process, view: View) -> None:
    while not (session.is_over() or view.closed or process.runtime.wait(0)):
        view.spin(_SPIN_S)
        process.follow()


def _configured(graph: Graph, namespaces: Mapping[str, str], options: Iterable[str]) -> Graph:
    """The graph with the parameters that launch files and command line gave to its nodes."""
    source = graph.source

    def configured(member: M) -> M:
        kind = playing_params(source.type) if member is source else type(member.params)
        values = starting_values(kind, namespaces[member.name], options)
        for name, value in values.items():
            if isinstance(value, str):
                values[name] = session.find_file(value)
        return replace(member, params=update(kind(), values))

    return graph.changed(configured)


def _playback(graph: Graph, stays: bool) -> Playback | None:
    """How the source is played; while somebody looks or can command it, it stays at its end."""
    if graph.source is None:
        return None
    source = graph.source.type
    params, duration_s = graph.source.params, float(session.option("duration", 0.0))
    is_played = isinstance(params, PlayingParams)
    return Playback(
        rate=params.rate if is_played else 1.0,
        loop=is_played and params.loop,
        start_s=float(session.option("start", 0.0)),
        duration_s=duration_s or None,
        hold=(stays or bool(source.inputs)) and not duration_s,
        live_stamps=not source.makes_time,
        clock=WallClock() if source.makes_time else ros_clock(),
    )


def _open_view() -> View:
    """What ``~view`` asks for; without a screen for it the node runs all the same."""
    name, options = _view_options("none")
    try:
        return open_view(name, options)
    except OpenError as error:
        log.warning("no %s here, running without: %s", name, error)
        return open_view("none", options)


def _view_options(default: str) -> tuple[str, ViewOptions]:
    """Which view, and how it is opened."""
    options = ViewOptions(
        host=str(session.option("host", "127.0.0.1")),
        port=int(session.option("port", 8080)),
        origins=_named_in("allow_origin", "none"),
        record_dir=Path(session.find_file(str(session.option("record_dir", ".")))),
        place=str(session.option("window", "")),
    )
    return str(session.option("view", default)), options


def _wants_compressed() -> bool:
    transport = session.option("image_transport", "raw")
    if transport not in ("raw", "compressed"):
        raise UsageError(f"image_transport={transport}: choose raw or compressed")
    return bool(transport == "compressed")


_OTHERS = {"pipeline": _run_pipeline, "player": _run_player, "viewer": _run_viewer}
