"""The graph that a command runs: of the source that a person selected, by the options given."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from ros_visualise.core.errors import ParameterError, UsageError
from ros_visualise.core.params import specs
from ros_visualise.core.printing import without_secrets
from ros_visualise.data import Image
from ros_visualise.graph import IMAGE_NODES, Graph
from ros_visualise.graph.landmarks import with_known_places, with_tags
from ros_visualise.graph.pipelines import (
    film_pipeline,
    image_pipeline,
    picture_pipeline,
    recording_pipeline,
    server_pipeline,
)
from ros_visualise.graph.presets import preset
from ros_visualise.graph.vehicles import guiding_vehicles, with_vehicles
from ros_visualise.graph.visual_odometry import with_visual_odometry
from ros_visualise.nodes import find_node
from ros_visualise.nodes.path import PathParams
from ros_visualise.running.arguments import parse_setting
from ros_visualise.running.options import (
    NetworkOptions,
    NodeOptions,
    PlayingOptions,
    SettingOptions,
)
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.saving import load
from ros_visualise.sources.alignment import read_offsets
from ros_visualise.sources.calibration import read_calibration
from ros_visualise.sources.opening import is_recording, open_joined, open_recording
from ros_visualise.sources.recordings.joined import JoinedRecording
from ros_visualise.sources.servers import is_server
from ros_visualise.sources.servers.connection import Connection

log = logging.getLogger(__name__)

_NONE = "none"
_PATH = "path"
_OF_RECORDINGS = ("tf_parent", "tf_child")
"""Parameters of a node that hold for one recording alone."""


@dataclass(frozen=True)
class Selection:
    """A source that a person selected to play.

    Attributes:
        name: a few words for the title of the page.
        graph: makes its graph: the source, and the nodes that every run of it has. What it opens
            goes on the stack, which closes it if no run comes of it.
        path: its file, folder or device; empty: none.
        more: what is played with it.
        size: that images are scaled to, also those of what is opened in its place.
        is_recording: its topics are chosen by options.
        another: selects another file in its place; None: as the commands ``bag`` or ``video`` do.
    """

    name: str
    graph: Callable[[ExitStack], Graph]
    path: str = ""
    more: tuple[str, ...] = ()
    size: str = ""
    is_recording: bool = False
    another: Callable[[str], Selection] | None = None


def recording(
    path: str,
    topics: Sequence[str] = (),
    image: str | None = None,
    odom: str | None = None,
    more: Sequence[str] = (),
    offsets: Sequence[str] = (),
) -> Selection:
    """A recording; without topics all are played, and the first images and odometry are used.

    ``more``: recordings and films that are played with it; ``offsets``: as of ``--offset``.
    """
    if offsets and not more:
        raise UsageError(f"--offset {offsets[0]}: needs several recordings or videos")

    def graph(undo: ExitStack) -> Graph:
        chosen = ["" if topic == _NONE else topic for topic in (image, odom)]
        if not more:
            opened = undo.enter_context(closing(open_recording(path)))
            return recording_pipeline(opened, topics, *chosen)
        joined = undo.enter_context(closing(open_joined([Path(one) for one in (path, *more)])))
        moved = dict(zip(joined.names, read_offsets(offsets, joined), strict=True))
        _report_alignment(joined, moved)
        graph = recording_pipeline(joined, topics, *chosen)
        return graph.configured({"player": moved})

    name = ", ".join(Path(one).resolve().name for one in (path, *more))
    return Selection(name, graph, path, tuple(more), is_recording=True)


def _report_alignment(joined: JoinedRecording, moved: Mapping[str, float]) -> None:
    parts = zip(joined.names, joined.paths, joined.is_aligned, joined.frames, strict=True)
    for name, path, is_aligned, frames in parts:
        how = "aligned by its timestamps" if is_aligned else "starts together with the others"
        way = f"--offset {name}=SECONDS shifts it in time"
        by = f"shifted by {moved[name]:g} s" if moved[name] else way

        log.info("%s: %s; %s", path.name, how, by)
        if frames is not None:
            why = "another source publishes frames with the same names"
            log.info("%s: frames renamed to %s/..., because %s", path.name, name, why)


def server(
    address: str, topics: Sequence[str] = (), image: str | None = None, odom: str | None = None
) -> Selection:
    """A server of live messages; otherwise as `recording`."""

    def graph(undo: ExitStack) -> Graph:
        connection = undo.enter_context(closing(Connection(address)))
        chosen = ["" if topic == _NONE else topic for topic in (image, odom)]
        return server_pipeline(connection, topics, *chosen)

    return Selection(without_secrets(address), graph, address)


def film(path: str, size: str) -> Selection:
    """A film, or a folder of pictures; its images are scaled to the size, if any."""

    def graph(_: ExitStack) -> Graph:
        if os.path.isdir(path):
            return picture_pipeline(path)
        return film_pipeline(path, **sized_to(size))

    return Selection(Path(path).resolve().name, graph, path, size=size)


def stream(address: str, size: str) -> Selection:
    """A live camera or a stream; its images are scaled to the size, if any."""
    # the name is not the address, which may hold a password
    build = partial(image_pipeline, "camera", uri=address, **sized_to(size))
    return Selection("camera", lambda _: build(), address, size=size)


def sized_to(size: str) -> dict[str, str]:
    """The parameter of a source of images for a size, if any."""
    return {"size": size} if size else {}


def graph_of(selection: Selection, options: NodeOptions) -> Graph:
    """The graph of a selection, with all nodes and parameters that options give.

    Raises:
        OpenError: the source, a node's file or the file of parameters cannot be opened.
        UsageError: an option does not fit the source.
    """
    with ExitStack() as undo:
        vehicles = options.mavlink if isinstance(options, NetworkOptions) else ()
        graph = with_vehicles(selection.graph(undo), vehicles)
        graph = with_visual_odometry(graph, options.visual_odometry, options.navigate is not None)
        graph = with_tags(graph, options.landmarks, options.navigate)
        graph = guiding_vehicles(with_known_places(_with_nodes(graph, options.node)))
        if options.preset:
            graph = graph.configured(preset(options.preset, graph))
        graph = with_settings(graph, options, selection.is_recording)
        _check_path(graph)
        url = getattr(graph.source.params, "camera_info_url", "") if graph.source else ""
        if url:
            read_calibration(url)  # a source would wait for the file
        undo.pop_all()  # the graph closes what is open
        return graph


def following(
    selection: Selection,
    options: PlayingOptions,
    path: Path | str,
    runtime: LocalRuntime,
    adds: bool = False,
) -> tuple[Selection, PlayingOptions, Graph]:
    """A source opened from the page, its options, and its graph with the current parameters.

    A path is a file, a text the address of a stream. If it ``adds``, the file is played with those
    of before.

    ``selection``, ``options`` and ``runtime`` are those of the run before. Raises as `graph_of`.
    """
    assert runtime.playback is not None
    state, source = runtime.playback.state, runtime.graph.source
    if adds:
        selected = _joined(selection, str(path), runtime)
    elif isinstance(path, str):
        selected = server(path) if is_server(path) else stream(path, selection.size)
    elif selection.another is not None:
        selected = selection.another(str(path))
    elif is_recording(path):
        selected = replace(recording(str(path)), size=selection.size)
    else:
        selected = film(str(path), selection.size)
    options = replace(  # without what was for the first file, or is done
        options,
        start=None,
        duration=None,
        set=[],
        params=None,
        preset="",
        record=[],
        paused=not (state.playing or state.ended),
        rate=None if isinstance(path, str) else state.rate,
        loop=not isinstance(path, str) and state.loop and not (source and source.type.seamless),
    )
    graph = graph_of(selected, options)
    return selected, options, graph.configured(_current_settings(runtime, graph))


def _joined(selection: Selection, path: str, runtime: LocalRuntime) -> Selection:
    """A selection with another file; the offsets of those that are played stay."""
    if not os.path.exists(selection.path) or selection.another is not None:
        raise UsageError(f"{path}: can only be added to a recording or a video")
    offsets, source = [], runtime.graph.source
    if source is not None and runtime.playback is not None:
        moved = runtime.parameters[source.name].current
        offsets = [f"{one.title}={getattr(moved, one.name)}" for one in runtime.playback.sources]
    joined = recording(selection.path, more=[*selection.more, path], offsets=offsets)
    return replace(joined, size=selection.size)


def _current_settings(runtime: LocalRuntime, graph: Graph) -> dict[str, dict[str, Any]]:
    """Node -> its current parameters, of those that another graph has too."""
    kinds = {node.name: type(node.params) for node in runtime.graph.nodes}
    return {
        node.name: {
            name: value
            for name, value in vars(runtime.parameters[node.name].current).items()
            if name not in _OF_RECORDINGS
        }
        for node in graph.nodes
        if kinds.get(node.name) is type(node.params)
    }


def _with_nodes(graph: Graph, texts: Sequence[str]) -> Graph:
    """The graph with more nodes: by default after filters, else after the source."""
    names = [member.name for member in graph.members]
    last = "filters" if "filters" in names else names[0]
    for text in texts:
        wanted = parse_insertion(text)
        added = find_node(wanted.node)
        graph = graph.insert(added, wanted.after or last, wanted.topics)
        passed = [kind for port, kind in added.outputs.items() if port not in added.on_demand]
        passes_on = [*added.stepped.values()] in [[kind] for kind in passed]
        if passes_on and not wanted.after:
            last = added.name
    return graph


class Insertion(NamedTuple):
    """A node, the one before it, and topics for its inputs; None if it does not say."""

    node: str
    after: str | None
    topics: dict[str, str]


def parse_insertion(text: str) -> Insertion:
    """``NODE[@AFTER][,INPUT=TOPIC ...]``, NODE as for `ros_visualise.nodes.find_node`.

    Raises:
        UsageError: another form.
    """
    path, colon, rest = text.rpartition(":")
    name, *chosen = rest.split(",")
    name, _, after = name.partition("@")
    topics = dict(one.partition("=")[::2] for one in chosen)
    if not all(topics.values()) or len(topics) < len(chosen):
        raise UsageError(f"{text}: give a node as NODE, NODE@AFTER or NODE@AFTER,INPUT=/topic")
    return Insertion(path + colon + name, after or None, topics)


def with_settings(graph: Graph, options: SettingOptions, is_recording: bool = False) -> Graph:
    """The graph with the parameters of ``--params`` and ``--set``; raises as `graph_of`.

    ``is_recording``: the command has ``--odom``, which a path follows.
    """
    if options.params:
        try:
            graph = _configured(graph, load(options.params), is_recording)
        except ParameterError as error:
            raise UsageError(f"{options.params}: {error}") from None
    for text in options.set:
        node, param, value = parse_setting(text, partial(_with_node, graph))
        graph = _configured(graph, {node: {param: value}}, is_recording)
    return graph


def _with_node(graph: Graph, param: str) -> str:
    """A hint for a parameter without its node."""
    for member in graph.members:
        if param in {spec.name for spec in specs(member.type.params)}:
            return f"; did you mean {member.name}.{param}?"
    return ""


def _configured(graph: Graph, settings: dict[str, dict[str, Any]], is_recording: bool) -> Graph:
    has_path = any(node.name == _PATH for node in graph.nodes)
    if _PATH in settings and not has_path and is_recording:
        raise UsageError(
            "no node 'path': this recording has no odometry; add --odom TOPIC, or"
            " --odom /tf:PARENT.CHILD for two frames"
        )
    return graph.configured(settings)


def _check_path(graph: Graph) -> None:
    """Reject a path of a frame without transforms, which would stay empty for ever."""
    for node in graph.nodes:
        if not isinstance(node.params, PathParams) or "tf" in node.inputs:
            continue
        if node.params.tf_parent or node.params.tf_child:
            raise UsageError(
                f"{node.name}: no tf; leave tf_parent and tf_child empty, or, to follow one frame"
                " of a recording in another, give --odom /tf:PARENT.CHILD"
            )


def stepped_topic(graph: Graph) -> str:
    """The topic that a person steps through in a recording: its processed images, if any."""
    if graph.source is None or not any(node.name == IMAGE_NODES[0] for node in graph.nodes):
        return ""
    taken = {topic for node in graph.nodes for topic in node.inputs.values()}
    outputs, kinds = graph.source.outputs, graph.source.type.outputs
    return next(port for port in outputs if kinds[port] is Image and outputs[port] in taken)
