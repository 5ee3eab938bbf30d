"""Running a graph, and taking every message of its topics."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from functools import partial
from os import PathLike, fspath
from typing import Any, TypeVar, overload

from ros_visualise.api.reading import Sample
from ros_visualise.core.errors import OpenError, RosVisualiseError, UsageError, did_you_mean
from ros_visualise.core.message import Message
from ros_visualise.graph import Graph
from ros_visualise.messages.recorded import content
from ros_visualise.running.graphs import film, recording, stream
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.ordering import Ordering
from ros_visualise.runtime.record_queue import OrderedQueue
from ros_visualise.runtime.topics import CallbackListener
from ros_visualise.sources.camera import is_live
from ros_visualise.sources.opening import is_recording
from ros_visualise.sources.playback import Playback

M = TypeVar("M", bound=Message)

_END_S = 60.0


class NodeFailed(RosVisualiseError):
    """A node or the source of a graph failed; the message names it, ``__cause__`` is its error."""


def pipeline(path: str | PathLike[str]) -> Graph:
    """The graph that ``ros-visualise THING`` runs: a film, a folder, a recording, a camera.

    `Graph.insert` adds a node to it, `Graph.configured` sets parameters.

    Raises:
        OpenError: no such file, or the recording cannot be opened; what else cannot be opened is
            noticed by `run`.
    """
    name = fspath(path)
    if is_live(name):
        selected = stream(name, "")
    elif not os.path.exists(name):
        raise OpenError.missing(name)
    elif is_recording(name):
        selected = recording(name)
    else:
        selected = film(name, "")
    with ExitStack() as undo:
        graph = selected.graph(undo)
        undo.pop_all()  # its source closes what is open
        return graph


@overload
def run(graph: Graph, topics: str | Collection[str] = ...) -> Iterator[Sample[Message]]: ...


@overload
def run(
    graph: Graph, topics: str | Collection[str] = ..., *, kind: type[M]
) -> Iterator[Sample[M]]: ...


def run(
    graph: Graph, topics: str | Collection[str] = (), *, kind: type[Any] = Message
) -> Iterator[Sample[Any]]:
    """Run a graph to its end, as fast as possible, and give every message of some topics.

    Nothing is dropped, as nodes and source wait for the loop; two runs give the same messages in
    the same order. Leaving the loop ends the run. A live source cannot wait: of a camera, images
    are dropped where nodes are slow.

    Args:
        graph: with a source; `pipeline` makes one.
        topics: a topic or several; empty: all of this kind, without those on demand.
        kind: class of the messages.

    Raises:
        UsageError: no such topic, or the graph has no source.
        NodeFailed: a node or the source failed.
    """
    wanted = _wanted(graph, [topics] if isinstance(topics, str) else topics, kind)
    if graph.source is None:
        raise UsageError("the graph has no source; make the graph with pipeline(PATH)")
    runtime = LocalRuntime(graph, Playback(rate=0))
    order = Ordering(graph, wanted)
    queue = OrderedQueue(order, "run")
    for topic in order.inputs:
        listener = CallbackListener(partial(queue.put, topic), partial(queue.finish, topic))
        runtime.topic(topic).connect(listener)
    runtime.start()
    try:
        while (found := queue.take()) is not None:
            topic, packet = found
            _raise_error(runtime)
            message = content(packet.message)
            stamp_ns = message.header.stamp_ns if packet.log_ns is None else packet.log_ns
            yield Sample(topic, stamp_ns, message)
        runtime.wait(_END_S)
        _raise_error(runtime)
    finally:
        queue.stop()
        runtime.stop()


def _wanted(graph: Graph, topics: Collection[str], kind: type[Message]) -> list[str]:
    for topic in topics:
        if topic not in graph.topics:
            raise UsageError(f"no topic {topic!r}{did_you_mean(topic, graph.topics)}")
        if not issubclass(found := graph.topics[topic].type, kind):
            raise UsageError(f"{topic}: its messages are {found.__name__}, not {kind.__name__}")
    return [
        name
        for name, topic in graph.topics.items()
        if (name in topics if topics else not topic.on_demand and issubclass(topic.type, kind))
    ]


def _raise_error(runtime: LocalRuntime) -> None:
    for name, error in runtime.errors.items():
        what = str(error) if isinstance(error, RosVisualiseError) else f"{type(error).__name__}"
        detail = "" if isinstance(error, RosVisualiseError) else f": {error}"
        raise NodeFailed(f"{name} failed: {what}{detail}") from error
