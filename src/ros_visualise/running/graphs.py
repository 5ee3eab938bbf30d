"""The graph that a playing command runs: of what was selected, with the nodes and parameters."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from ros_visualise.core.errors import ParameterError, UsageError
from ros_visualise.core.params import specs
from ros_visualise.data import Detections, Image
from ros_visualise.graph import Graph
from ros_visualise.graph.landmarks import NAVIGATOR, RECORDED_TAGS, TAGS, with_landmarks
from ros_visualise.graph.pipelines import (
    IMAGE_NODES,
    film_pipeline,
    image_pipeline,
    recording_pipeline,
)
from ros_visualise.graph.presets import preset
from ros_visualise.nodes import choose_node
from ros_visualise.nodes.path import PathParams
from ros_visualise.running.options import NodeOptions, SettingOptions
from ros_visualise.runtime.saving import load
from ros_visualise.sources.calibration import read_calibration
from ros_visualise.sources.opening import open_recording

_NONE = "none"
_PATH = "path"


@dataclass(frozen=True)
class Selection:
    """What a person selected to play.

    Attributes:
        name: a few words for the title of the page.
        graph: makes its graph: the source, and the nodes that every run of it has. What it opens
            goes on the stack, which closes it where no run comes of it.
        path: its file, folder or device; empty: none.
        size: that images are scaled to, also those of what is opened in its place.
        is_recording: its topics are chosen by options.
        another: selects another file in its place; None: as the commands ``bag`` or ``video`` do.
    """

    name: str
    graph: Callable[[ExitStack], Graph]
    path: str = ""
    size: str = ""
    is_recording: bool = False
    another: Callable[[str], Selection] | None = None


def recording(
    path: str, topics: Sequence[str] = (), image: str | None = None, odom: str | None = None
) -> Selection:
    """A recording.

    Args:
        path: file or folder.
        topics: those that are played; none: all.
        image: topic that goes through the nodes, or ``none``; None: the first.
        odom: topic that the path is drawn from, or ``none``; None: the first.
    """

    def graph(undo: ExitStack) -> Graph:
        opened = undo.enter_context(closing(open_recording(path)))
        return recording_pipeline(opened, topics, _topic(image), _topic(odom))

    return Selection(Path(path).resolve().name, graph, path, is_recording=True)


def film(path: str, size: str) -> Selection:
    """A film, or a folder of pictures; its images are scaled to that size, if one is given."""

    def graph(_: ExitStack) -> Graph:
        if os.path.isdir(path):
            return image_pipeline("pictures", path=path)
        return film_pipeline(path, **sized_to(size))

    return Selection(Path(path).resolve().name, graph, path, size)


def sized_to(size: str) -> dict[str, str]:
    """The parameter of a source of images for a size, if one is given."""
    return {"size": size} if size else {}


def graph_of(selection: Selection, options: NodeOptions) -> Graph:
    """The graph of a selection with all that options add and set.

    Raises:
        OpenError: the source, a node's file or the file of parameters cannot be opened.
        UsageError: an option asks for what is not there.
    """
    with ExitStack() as undo:
        graph = selection.graph(undo)
        if options.landmarks or options.navigate is not None:
            graph = _with_tags(graph, options.navigate)
        graph = _with_options(graph, options, selection.is_recording)
        undo.pop_all()  # what is open is the graph's now
        return graph


def _with_tags(graph: Graph, navigate: str | None) -> Graph:
    """The same with nodes that look for tags in the images that are processed, if not there.

    Args:
        navigate: the map to navigate by, an empty text for a new one; None: do not.
    """
    there = {node.name for node in graph.nodes}
    first = next((node for node in graph.nodes if node.name == IMAGE_NODES[0]), None)
    found = [name for name, topic in graph.topics.items() if topic.type is Detections]
    if first is None and (navigate is None or not found):
        option = "--landmarks" if navigate is None else "--navigate"
        raise UsageError(f"{option}: there are no images to look for them in; leave it out")
    if TAGS not in there:
        topic, detector = (first.inputs["image"], TAGS) if first else (found[0], RECORDED_TAGS)
        graph = with_landmarks(graph, topic, [detector], navigate=navigate is not None)
    if navigate:
        return graph.configured({NAVIGATOR: {"map": navigate, "mode": "frozen"}})
    return graph


def _with_options(graph: Graph, options: NodeOptions, is_recording: bool) -> Graph:
    last = _where_nodes_go(graph)
    for text in options.node:
        wanted = parse_insertion(text)
        added = choose_node(wanted.node)
        after = wanted.after or last
        graph = graph.insert(added, after, wanted.topics)
        passes_on = [*added.stepped.values()] in [[kind] for kind in added.outputs.values()]
        if passes_on and not wanted.after:
            last = added.name
    if options.preset:
        graph = graph.configured(preset(options.preset, graph))
    graph = with_settings(graph, options, is_recording)
    _refuse_unfed_pair(graph)
    _refuse_missing_calibration(graph)
    return graph


class Insertion(NamedTuple):
    """A node, what it comes after, and topics for its inputs; None where it does not say."""

    node: str
    after: str | None
    topics: dict[str, str]


def parse_insertion(text: str) -> Insertion:
    """``NODE[@AFTER][,INPUT=TOPIC ...]``, with as many inputs as one wants to choose.

    NODE is as `ros_visualise.nodes.choose_node` takes it.

    Raises:
        UsageError: it is not of that form.
    """
    path, colon, rest = text.rpartition(":")
    name, *chosen = rest.split(",")
    name, _, after = name.partition("@")
    topics = dict(one.partition("=")[::2] for one in chosen)
    if not all(topics.values()) or len(topics) < len(chosen):
        raise UsageError(f"{text}: give a node as NODE, NODE@AFTER or NODE@AFTER,INPUT=/topic")
    return Insertion(path + colon + name, after or None, topics)


def with_settings(graph: Graph, options: SettingOptions, is_recording: bool = False) -> Graph:
    """The graph with the parameters of ``--params`` and ``--set``.

    Args:
        graph: what they are of.
        options: those two.
        is_recording: there is an option ``--odom``, which a path follows.

    Raises:
        OpenError: the file of parameters cannot be opened.
        UsageError: no such node or parameter, or a value out of its range.
    """
    if options.params:
        try:
            graph = _configured(graph, load(options.params), is_recording)
        except ParameterError as error:
            raise UsageError(f"{options.params}: {error}") from None
    for text in options.set:
        key, equals, value = text.partition("=")
        node, dot, param = key.partition(".")
        if not (equals and dot):
            raise UsageError(f"--set {text}: give NODE.PARAM=VALUE{_with_node(graph, key)}")
        graph = _configured(graph, {node: {param: value}}, is_recording)
    return graph


def _with_node(graph: Graph, param: str) -> str:
    """What was probably meant by a parameter without its node."""
    for member in graph.members:
        if param in {spec.name for spec in specs(member.type.params)}:
            return f"; did you mean {member.name}.{param}?"
    return ""


def _where_nodes_go(graph: Graph) -> str:
    """The node that one is inserted after, where nobody says: filters, else the source."""
    is_there = any(member.name == "filters" for member in graph.members)
    return "filters" if is_there else graph.members[0].name


def stepped_topic(graph: Graph) -> str:
    """What a person steps through in a recording: its images, where they are processed."""
    if graph.source is None or not any(node.name == IMAGE_NODES[0] for node in graph.nodes):
        return ""
    taken = {topic for node in graph.nodes for topic in node.inputs.values()}
    outputs, kinds = graph.source.outputs, graph.source.type.outputs
    return next(port for port in outputs if kinds[port] is Image and outputs[port] in taken)


def _configured(graph: Graph, settings: dict[str, dict[str, Any]], is_recording: bool) -> Graph:
    is_there = any(node.name == _PATH for node in graph.nodes)
    if _PATH in settings and not is_there and is_recording:
        raise UsageError(
            "no node 'path' here: name what it is to follow by --odom TOPIC, or two frames by"
            " --odom /tf:PARENT.CHILD"
        )
    return graph.configured(settings)


def _refuse_unfed_pair(graph: Graph) -> None:
    """A path that is to follow a frame by tf, and gets none, would stay empty for ever."""
    for node in graph.nodes:
        if not isinstance(node.params, PathParams) or "tf" in node.inputs:
            continue
        if node.params.tf_parent or node.params.tf_child:
            raise UsageError(
                f"{node.name}: no tf comes to it here, so leave tf_parent and tf_child empty; two"
                " frames of a recording are followed by --odom /tf:PARENT.CHILD"
            )


def _refuse_missing_calibration(graph: Graph) -> None:
    """A source waits for a file that is not there yet; a person who types its name does not."""
    url = getattr(graph.source.params, "camera_info_url", "") if graph.source else ""
    if url:
        read_calibration(url)


def _topic(name: str | None) -> str | None:
    return "" if name == _NONE else name
