"""The pipelines that there are, as graphs of nodes."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import OpenError, UsageError, did_you_mean
from ros_visualise.core.params import specs
from ros_visualise.data import (
    Image,
    NavSatFix,
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
    Transforms,
)
from ros_visualise.graph import Graph, Node, SourceNode, place, place_source
from ros_visualise.graph.landmarks import TAGS, tags_of_world, with_landmarks
from ros_visualise.messages.calibrations import info_topic
from ros_visualise.nodes import NODES, NodeType, SourceType, find_all, find_node, find_source
from ros_visualise.nodes.player import player
from ros_visualise.nodes.streamer import film
from ros_visualise.simulation.rendering import choose_backend
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.sources.frame_pairs import NamedPair, ask_for_pair, need_motion, parse_pair
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.images import first_image
from ros_visualise.vision.reshape import Size

log = logging.getLogger(__name__)

IMAGE_NODES = ("fps_control", "filters", "edge_detector")
"""The nodes that images pass in the pipelines, in order."""


def image_pipeline(source: str, **settings: Any) -> Graph:
    """``source`` -> fps_control -> filters -> edge_detector, on the topics of the ROS launch files.

    Args:
        source: name of a declared source of images.
        settings: its parameters.
    """
    added = tuple(find_node(name) for name in IMAGE_NODES)
    return chain(added, source).configured({source: settings})


def film_pipeline(path: str | Path, **settings: Any) -> Graph:
    """A video file through the image nodes, and the way by the fixes that it comes with, if any.

    Args:
        path: the file.
        settings: parameters of its source.
    """
    source = place_source(film(path))
    nodes = _chained([find_node(name) for name in IMAGE_NODES], source.outputs["image"])
    if "fix" in source.outputs:
        nodes += (place(find_node("path"), {"fix": source.outputs["fix"]}),)
    graph = _told_apart(Graph(source, nodes)).with_frames()
    return graph.configured({source.name: {"path": str(path), **settings}})


def chain(added: Sequence[NodeType], source: str | None = None) -> Graph:
    """Nodes that pass on images, each to the next, from ``source`` or the topic ``/image_raw``.

    Raises:
        UsageError: two of the same name, or one whose input is not what comes before it.
    """
    graph = Graph(place_source(find_source(source)) if source else None, _chained(added))
    return _told_apart(graph).with_frames()


def _chained(added: Sequence[NodeType], topic: str = "/image_raw") -> tuple[Node, ...]:
    """Nodes that pass on images, each to the next, the first from ``topic``."""
    nodes: tuple[Node, ...] = ()
    given = Image
    for declared in added:
        if any(node.name == declared.name for node in nodes):
            raise UsageError(f"{declared.name}: is there twice")
        if list(declared.stepped.values()) != [given]:
            raise UsageError(f"{declared.name}: needs one input of type {given.__name__}")
        inputs = {next(iter(declared.stepped)): topic}
        node = place(declared, inputs)
        nodes += (node,)
        passed = [p for p, made in declared.outputs.items() if made is given]
        topic = next((node.outputs[p] for p in passed if p not in declared.on_demand), topic)
    return nodes


def recording_pipeline(
    recording: Recording,
    topics: Collection[str] = (),
    image: str | None = None,
    odom: str | None = None,
) -> Graph:
    """A recording, one of its image topics through the image nodes, and its odometry to path.

    A recorded topic that is called as one that a node publishes, or as that of the calibration that
    goes with it, is played below ``/recorded``.

    Args:
        recording: it is open.
        topics: of these alone; none: of all.
        image: the topic of images; None: the first one of gray or colours, an empty text: none.
        odom: the topic that the path is made of, or a pair of frames, as
            `ros_visualise.sources.frame_pairs.parse_pair`; None: the first of odometry, else of
            poses, else of positions; an empty text: none.

    Raises:
        UsageError: a topic is not there or not of the right type.
    """
    declared = player(recording, topics)
    if image is None:
        images = [name for name, cls in declared.outputs.items() if cls is Image]
        image = first_image(recording, sorted(images, key=made_topics().__contains__))
    else:
        image = _choose(declared, "--image", image, (Image,))
    pair = _find_pair(recording, declared, odom) if odom else None
    odom = odom if pair else _choose(declared, "--odom", odom, tuple(_PATH_INPUTS))
    added = [find_node(name) for name in IMAGE_NODES] if image else []
    outputs = _kept_apart(declared.outputs, added, {"/path"} if odom else set())
    source = SourceNode("player", declared, declared.params(), {}, outputs)
    nodes = _chained(added, outputs[image]) if image else ()
    if pair:
        nodes += (_following(pair, outputs),)
    elif odom:
        port = _PATH_INPUTS[declared.outputs[odom]]
        nodes += (place(find_node("path"), {port: outputs[odom]}),)
    return _told_apart(Graph(source, nodes))


def made_topics() -> frozenset[str]:
    """Topics on which nodes of ours publish: those in a recording went through them already."""
    nodes = [one for one in find_all() if isinstance(one, NodeType)]
    return frozenset(topic for node in nodes for topic in place(node, {}).topics)


def _told_apart(graph: Graph) -> Graph:
    """The same, of two nodes that show one picture that put aside which has less to set."""
    passing = next((node for node in graph.nodes if node.name == IMAGE_NODES[0]), None)
    source = graph.source
    if source is None or passing is None or not set(passing.inputs.values()) & set(source.topics):
        return graph
    images = [kind for kind in source.type.outputs.values() if kind is Image]
    live = [spec for spec in specs(source.params) if not spec.restart]
    if live or source.type.actions or len(images) > 1:
        nodes = (replace(node, aside=node is passing or node.aside) for node in graph.nodes)
        return replace(graph, nodes=tuple(nodes))
    return replace(graph, source=replace(source, aside=True))


def _kept_apart(
    recorded: Iterable[str], added: Sequence[NodeType], also_made: Collection[str]
) -> dict[str, str]:
    """Recorded topic -> its name in the graph, which none that is made there has."""
    made = {topic for node in added for topic in place(node, {}).outputs.values()}
    made |= {info_topic(topic) for topic in made} | set(also_made)
    return {name: f"/recorded{name}" if name in made else name for name in recorded}


def simulation_pipeline(
    robot: str,
    size: Size | None = None,
    landmarks: bool = False,
    navigate: bool = False,
    **settings: Any,
) -> Graph:
    """A simulated robot, its images through the image nodes, and its odometry to path.

    Args:
        robot: name of a declared source that simulates one.
        size: (width, height) of its images; None: its own.
        landmarks: look for tags in them, and put them into a map.
        navigate: look for tags, and tell by them where the robot is.
        settings: its parameters.

    Raises:
        UsageError: there is no such robot; those that there are are listed.
    """
    ROBOTS.find(robot)
    source = place_source(find_source(robot))
    images = _chained([find_node(name) for name in IMAGE_NODES], source.outputs["image"])
    path = place(find_node("path"), {"odom": source.outputs["odom"]})
    if size is not None:
        settings |= {"camera_width": size[0], "camera_height": size[1]}
    graph = _told_apart(Graph(source, (*images, path))).configured({robot: settings})
    if not (landmarks or navigate):
        return graph
    tags = {"tags": tags_of_world(settings.get("world", "field"))}
    return with_landmarks(graph, source.outputs["image"], [TAGS], {TAGS: tags}, navigate)


def demo_pipeline(
    source: str | None = None,
    size: Size | None = None,
    landmarks: bool = False,
    navigate: bool = False,
) -> Graph:
    """A robot on its default mission, again and again, or a source of images that needs no file.

    Args:
        source: its name; None: the quadrotor, or the landscape where that cannot be simulated.
        size: (width, height) of the images; None: the source's own.
        landmarks, navigate: of a robot, as with `simulation_pipeline`.
    """
    if source is None:
        source = _demo_source()
    if source in ROBOTS.names():
        return simulation_pipeline(
            source, size, landmarks, navigate, mission="default", repeat=True
        )
    return image_pipeline(source, **({} if size is None else {"size": "{}x{}".format(*size)}))


def _demo_source() -> str:
    if find_spec("mujoco") is None:
        log.info("showing a drawn landscape; for the quadrotor, pip install 'ros_visualise[sim]'")
        return "landscape"
    try:
        choose_backend()
    except OpenError as error:
        log.warning("showing a drawn landscape; the quadrotor needs more: %s", error)
        return "landscape"
    return "quadrotor"


_PATH_INPUTS: dict[type, str] = {
    Odometry: "odom",
    PoseStamped: "pose",
    PoseWithCovarianceStamped: "pose_cov",
    NavSatFix: "fix",
}
"""What path can follow -> its input, the best first."""


def _find_pair(recording: Recording, played: SourceType, odom: str) -> NamedPair | None:
    """The pair of frames that the path is to follow; None where it is to follow a topic."""
    if played.outputs.get(odom) is Transforms:
        raise UsageError(ask_for_pair(recording, f"--odom {odom}"))
    if ":" not in odom:
        return None
    pair = parse_pair(recording, odom)
    if pair.topic not in played.outputs:
        raise UsageError(f"--odom {odom}: {pair.topic} is not played; add it to --topics")
    pair = pair._replace(static=pair.static if pair.static in played.outputs else None)
    need_motion(recording, pair)
    return pair


def _following(pair: NamedPair, topics: Mapping[str, str]) -> Node:
    """The path node on the topics of a pair of frames."""
    inputs = {"tf": topics[pair.topic]}
    if pair.static:
        inputs["tf_static"] = topics[pair.static]
    frames = {"tf_parent": pair.parent, "tf_child": pair.child}
    return place(find_node("path"), inputs).configured(frames)


def _choose(
    source: SourceType, option: str, wanted: str | None, kinds: Sequence[type]
) -> str | None:
    """The topic that is wanted, or the first one of these kinds."""
    fitting = [name for kind in kinds for name, cls in source.outputs.items() if cls is kind]
    if wanted is None:
        return next(iter(fitting), None)
    if wanted and wanted not in fitting:
        names = " or ".join(kind.__name__ for kind in kinds)
        raise UsageError(
            f"{option} {wanted}: no such topic of {names}{did_you_mean(wanted, fitting)}"
        )
    return wanted or None


def alone(declared: NodeType | SourceType) -> Graph:
    """One node by itself, on the topics that it has in the pipelines.

    A node that is in none listens to topics that are called as its inputs.
    """
    if isinstance(declared, SourceType):
        return Graph(place_source(declared), ())
    if declared.name in IMAGE_NODES:
        whole = chain([find_node(name) for name in IMAGE_NODES])
        return Graph(None, tuple(node for node in whole.nodes if node.name == declared.name))
    is_ours = declared.name in NODES.builtin and find_node(declared.name) is declared
    if is_ours and Image in declared.stepped.values():
        return chain([declared])
    return Graph(None, (place(declared, {port: f"/{port}" for port in declared.inputs}),))
