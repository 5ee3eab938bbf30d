"""Which graph a playing command runs, and with which parameters."""

from __future__ import annotations

import os
from argparse import Namespace
from collections.abc import Callable
from contextlib import ExitStack, closing
from typing import Any

from ros_visualise.commands.insertion import parse_insertion
from ros_visualise.commands.lesson_graphs import lesson_graph
from ros_visualise.data import Detections, Image
from ros_visualise.errors import ParameterError, UsageError
from ros_visualise.graph import Graph
from ros_visualise.landmark_pipelines import NAVIGATOR, RECORDED_TAGS, TAGS, with_landmarks
from ros_visualise.nodes import choose_node
from ros_visualise.nodes.path import PathParams
from ros_visualise.params import specs
from ros_visualise.pipelines import (
    IMAGE_NODES,
    demo_pipeline,
    film_pipeline,
    image_pipeline,
    recording_pipeline,
    simulation_pipeline,
)
from ros_visualise.presets import preset
from ros_visualise.runtime.saving import load
from ros_visualise.sources.calibration import read_calibration
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.video_pixels import parse_size

_NONE = "none"
_PATH = "path"


def graph_of(args: Namespace) -> Graph:
    """The graph of a command with all that its options add and set.

    Raises:
        OpenError: the source, a node's file or the file of parameters cannot be opened.
        UsageError: an option asks for what is not there.
    """
    with ExitStack() as undo:
        if args.command in _RECORDED:
            recording = undo.enter_context(closing(open_recording(args.input)))
            graph = _recording(recording, args)
        else:
            graph = _GRAPHS[args.command](args)
        if args.landmarks or args.navigate is not None:
            graph = _with_tags(graph, args.navigate)
        graph = _with_options(graph, args)
        undo.pop_all()  # the recording is the graph's now
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


def _with_options(graph: Graph, args: Namespace) -> Graph:
    last = _where_nodes_go(graph)
    for text in args.node:
        wanted = parse_insertion(text)
        added = choose_node(wanted.node)
        after = wanted.after or last
        graph = graph.insert(added, after, wanted.topics)
        passes_on = [*added.stepped.values()] in [[kind] for kind in added.outputs.values()]
        if passes_on and not wanted.after:
            last = added.name
    if args.preset:
        graph = graph.configured(preset(args.preset, graph))
    graph = with_settings(graph, args)
    _refuse_unfed_pair(graph)
    _refuse_missing_calibration(graph)
    return graph


def with_settings(graph: Graph, args: Namespace) -> Graph:
    """The graph with the parameters of ``--params`` and ``--set``.

    Raises:
        OpenError: the file of parameters cannot be opened.
        UsageError: no such node or parameter, or a value out of its range.
    """
    if args.params:
        try:
            graph = _configured(graph, load(args.params), args)
        except ParameterError as error:
            raise UsageError(f"{args.params}: {error}") from None
    for text in args.set:
        key, equals, value = text.partition("=")
        node, dot, param = key.partition(".")
        if not (equals and dot):
            raise UsageError(f"--set {text}: give NODE.PARAM=VALUE{_with_node(graph, key)}")
        graph = _configured(graph, {node: {param: value}}, args)
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


def _demo(args: Namespace) -> Graph:
    return demo_pipeline(
        args.scene, parse_size(args.size), args.landmarks is not False, args.navigate is not None
    )


def _sim(args: Namespace) -> Graph:
    mission = args.mission or _NONE
    if mission == _NONE and args.view == "none" and args.duration is None and args.frames is None:
        raise UsageError(
            "the robot has nothing to do and would stand still for ever: add --mission "
            "lawn_mower or --duration 60"
        )
    scenario = {"world": args.world, "mission": mission, "seed": args.seed}
    landmarks, navigate = args.landmarks is not False, args.navigate is not None
    return simulation_pipeline(args.robot, parse_size(args.size), landmarks, navigate, **scenario)


def _video(args: Namespace) -> Graph:
    if os.path.isdir(args.input):
        return image_pipeline("pictures", path=args.input)
    return film_pipeline(args.input, **_size(args))


def _camera(args: Namespace) -> Graph:
    if args.rate is not None or args.loop or args.start is not None:
        raise UsageError("a camera is live: it takes no --rate, --loop or --start")
    return image_pipeline("camera", uri=args.input, **_size(args))


def _recording(recording: Recording, args: Namespace) -> Graph:
    return recording_pipeline(recording, args.topics, _topic(args.image), _topic(args.odom))


_RECORDED = ("bag", "kitti")
_GRAPHS: dict[str, Callable[[Namespace], Graph]] = {
    "demo": _demo,
    "sim": _sim,
    "video": _video,
    "camera": _camera,
    "explain": lesson_graph,
}


def _configured(graph: Graph, settings: dict[str, dict[str, Any]], args: Namespace) -> Graph:
    is_there = any(node.name == _PATH for node in graph.nodes)
    if _PATH in settings and not is_there and args.command in _RECORDED:
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


def _size(args: Namespace) -> dict[str, str]:
    return {"size": args.size} if args.size else {}


def _topic(name: str | None) -> str | None:
    return "" if name == _NONE else name
