"""Builder of graphs: a source, the nodes that its images pass, and the path of its robot."""

from __future__ import annotations

import logging
import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack, closing
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ros_visualise.core.errors import OpenError, UsageError, did_you_mean
from ros_visualise.data import (
    Image,
    NavSatFix,
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
    Transforms,
)
from ros_visualise.graph import IMAGE_NODES, Graph, Node, SourceNode, place, place_source
from ros_visualise.messages.calibrations import info_topic
from ros_visualise.nodes import NODES, NodeType, SourceType, find_all, find_node, find_source
from ros_visualise.nodes.pictures import pictures
from ros_visualise.nodes.player import player
from ros_visualise.nodes.streamer import film
from ros_visualise.simulation.rendering import choose_backend
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.sources.opening import is_recording, open_recording
from ros_visualise.sources.pictures import is_pictures
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.images import first_image
from ros_visualise.sources.servers.connection import Connection
from ros_visualise.sources.servers.source import server_source
from ros_visualise.sources.trajectories import NamedPair, ask_for_pair, need_motion, parse_pair
from ros_visualise.vision.reshape import Size

log = logging.getLogger(__name__)


def build(
    source: SourceNode | str | None,
    images: str = "",
    path: Node | None = None,
    through: Sequence[str | NodeType] = IMAGE_NODES,
) -> Graph:
    """A source, nodes that its images pass, and the path of its robot.

    Args:
        source: the source, or its name; None: messages come from outside.
        images: topic of the images; empty: none.
        path: the node `path` on its topics; None: none.
        through: the nodes that images pass, or their names, in order.

    Raises:
        UsageError: two nodes of the same name, or one that takes no images.
    """
    added = [find_node(one) if isinstance(one, str) else one for one in through]
    placed = source_named(source) if isinstance(source, str) else source
    graph = Graph(placed, ()).chained(added if images else (), images)
    return graph if path is None else graph.joined(path)


def source_named(name: str, **settings: Any) -> SourceNode:
    """The source of that name with these parameters.

    Raises:
        UsageError: no such source or parameter, or a value out of its range.
    """
    return place_source(find_source(name)).configured(settings)


def image_pipeline(source: str, **settings: Any) -> Graph:
    """A source of images through the image nodes; ``settings`` are the source's parameters."""
    return build(source, "/image_raw").configured({source: settings})


def picture_pipeline(path: str) -> Graph:
    """A picture or a folder of pictures, otherwise as `film_pipeline`."""
    return _with_fixes(picture_source(path))


def picture_source(path: str) -> SourceNode:
    """A source of a picture, or a folder of pictures."""
    return place_source(pictures(path)).configured({"path": path})


def film_source(path: str | Path) -> SourceNode:
    """A source of a video file, and of its telemetry."""
    return place_source(film(path)).configured({"path": str(path)})


def film_pipeline(path: str | Path, **settings: Any) -> Graph:
    """A video file through the image nodes, and the path of its GPS fixes, if any."""
    return _with_fixes(film_source(path).configured(settings))


def _with_fixes(source: SourceNode) -> Graph:
    fixes = source.outputs.get("fix")
    return build(source, source.outputs["image"], _path({"fix": fixes}) if fixes else None)


def recording_pipeline(
    recording: Recording,
    topics: Collection[str] = (),
    image: str | None = None,
    odom: str | None = None,
) -> Graph:
    """A recording, one of its image topics through the image nodes, and the path of its odometry.

    A recorded topic with the name of one that a node publishes, or of its calibration, is played
    below ``/recorded``.

    Args:
        recording: it is open.
        topics: these alone; none: all.
        image: the topic of images; None: the first in gray or colour; empty: none.
        odom: the topic that the path is made of, or a pair of frames, see
            `ros_visualise.sources.trajectories.parse_pair`; None: the first of odometry, else of
            poses, else of positions; empty: none.

    Raises:
        UsageError: a topic is missing or of an unsuitable type.
    """
    declared = player(recording, topics)
    if image is None:
        images = [name for name, cls in declared.outputs.items() if cls is Image]
        image = first_image(recording, sorted(images, key=made_topics().__contains__))
    else:
        image = _choose(declared, "--image", image, (Image,))
    pair = _find_pair(recording, declared, odom) if odom else None
    odom = odom if pair else _choose(declared, "--odom", odom, tuple(_PATH_INPUTS))
    return _topics_pipeline(declared, image, odom, pair)


def server_pipeline(
    connection: Connection,
    topics: Collection[str] = (),
    image: str | None = None,
    odom: str | None = None,
) -> Graph:
    """A server of messages, in place of a recording; see `recording_pipeline`."""
    declared = server_source(connection, topics)
    kinds = declared.outputs.items()
    images = sorted((name for name, cls in kinds if cls is Image), key=made_topics().__contains__)
    if image is None:
        image = next(iter(images), None)
    else:
        image = _choose(declared, "--image", image, (Image,))
    odom = _choose(declared, "--odom", odom, tuple(_PATH_INPUTS))
    return _topics_pipeline(declared, image, odom)


def _topics_pipeline(
    declared: SourceType, image: str | None, odom: str | None, pair: NamedPair | None = None
) -> Graph:
    outputs = _kept_apart(declared.outputs, IMAGE_NODES if image else (), odom)
    path = None
    if pair:
        path = _following(pair, outputs)
    elif odom:
        path = _path({_PATH_INPUTS[declared.outputs[odom]]: outputs[odom]})
    return build(place_source(declared, outputs), outputs[image] if image else "", path)


def recorded_source(
    recording: Recording,
    topics: Collection[str] = (),
    calibrations: Mapping[str, str] = MappingProxyType({}),
) -> SourceNode:
    """A recording, with topics of the same names; see `ros_visualise.nodes.player.player`."""
    declared = player(recording, topics, calibrations=calibrations)
    return place_source(declared, {name: name for name in declared.outputs})


def open_input(path: str, undo: ExitStack, **robot: Any) -> SourceNode | Recording:
    """The source that a person names: a robot, pictures, a video; or an open recording.

    Args:
        path: a robot's name, or a file or folder, which goes first.
        undo: closes the recording.
        robot: parameters of a robot.

    Raises:
        OpenError: the recording cannot be opened.
    """
    if path in ROBOTS.names() and not os.path.exists(path):
        return source_named(path, **robot)
    if not is_recording(path):
        return picture_source(path) if is_pictures(path) else film_source(path)
    return undo.enter_context(closing(open_recording(path)))


def made_topics() -> frozenset[str]:
    """Topics that nodes of this package make: recorded ones went through them already.

    Those of live nodes are brought from outside, as by a source.
    """
    nodes = [one for one in find_all() if isinstance(one, NodeType) and not one.live]
    return frozenset(topic for node in nodes for topic in place(node, {}).topics)


def _kept_apart(recorded: Iterable[str], added: Iterable[str], odom: str | None) -> dict[str, str]:
    """Recorded topic -> its name in the graph, unlike those of all topics made there."""
    made = {topic for name in added for topic in place(find_node(name), {}).outputs.values()}
    made |= {info_topic(topic) for topic in made} | ({"/path"} if odom else set())
    return {name: f"/recorded{name}" if name in made else name for name in recorded}


def simulation_pipeline(robot: str, size: Size | None = None, **settings: Any) -> Graph:
    """A simulated robot, its images through the image nodes, and the path of its odometry.

    Args:
        robot: its name.
        size: (width, height) of its images; None: its own.
        settings: its parameters.

    Raises:
        UsageError: no such robot, world or parameter.
    """
    ROBOTS.find(robot)
    source = source_named(robot)
    if size is not None:
        settings |= {"camera_width": size[0], "camera_height": size[1]}
    graph = build(source, source.outputs["image"], _path({"odom": source.outputs["odom"]}))
    return graph.configured({robot: settings})


def demo_pipeline(source: str | None = None, size: Size | None = None) -> Graph:
    """A robot on its default mission, again and again, or a source of images that needs no file.

    Args:
        source: its name; None: the quadrotor, or the landscape where that cannot be simulated.
        size: (width, height) of the images; None: the source's own.
    """
    if source is None:
        source = _demo_source()
    if source in ROBOTS.names():
        return simulation_pipeline(source, size, mission="default", repeat=True)
    return image_pipeline(source, **({} if size is None else {"size": "{}x{}".format(*size)}))


def _demo_source() -> str:
    if find_spec("mujoco") is None:
        log.info(
            "showing a computer-drawn landscape; for the quadrotor, run:"
            " pip install 'ros_visualise[sim]'"
        )
        return "landscape"
    try:
        choose_backend()
    except OpenError as error:
        log.warning(
            "showing a computer-drawn landscape; the quadrotor cannot be simulated: %s", error
        )
        return "landscape"
    return "quadrotor"


_PATH_INPUTS: dict[type, str] = {
    Odometry: "odom",
    PoseStamped: "pose",
    PoseWithCovarianceStamped: "pose_cov",
    NavSatFix: "fix",
}
"""Type of messages that path can follow -> its input, the best first."""


def _find_pair(recording: Recording, played: SourceType, odom: str) -> NamedPair | None:
    """The pair of frames that the path follows; None if it follows a topic."""
    if played.outputs.get(odom) is Transforms:
        raise UsageError(ask_for_pair(recording, odom))
    if ":" not in odom:
        return None
    pair = parse_pair(recording, odom)
    if pair.topic not in played.outputs:
        raise UsageError(f"--odom {odom}: {pair.topic} is not played; add it to --topics")
    pair = pair._replace(static=pair.static if pair.static in played.outputs else None)
    need_motion(recording, pair)
    return pair


def _following(pair: NamedPair, topics: Mapping[str, str]) -> Node:
    """The node `path` on the topics of a pair of frames."""
    inputs = {"tf": topics[pair.topic]}
    if pair.static:
        inputs["tf_static"] = topics[pair.static]
    frames = {"tf_parent": pair.parent, "tf_child": pair.child}
    return _path(inputs).configured(frames)


def _path(inputs: Mapping[str, str]) -> Node:
    return place(find_node("path"), inputs)


def _choose(
    source: SourceType, option: str, wanted: str | None, kinds: Sequence[type]
) -> str | None:
    """The topic that is asked for, or the first of these kinds."""
    fitting = [name for kind in kinds for name, cls in source.outputs.items() if cls is kind]
    if wanted is None:
        return next(iter(fitting), None)
    if wanted and wanted not in fitting:
        names = " or ".join(kind.__name__ for kind in kinds)
        raise UsageError(
            f"{option} {wanted}: no such topic of type {names}{did_you_mean(wanted, fitting)}"
        )
    return wanted or None


def alone(declared: Any) -> Graph:
    """One node or source by itself, on the topics that it has in the pipelines.

    A node that is in none takes topics with the names of its inputs. ``declared`` is a declaration,
    or a function or class with one.
    """
    declared = getattr(declared, "declared", declared)
    if isinstance(declared, SourceType):
        return Graph(place_source(declared), ())
    if declared.name in IMAGE_NODES:
        whole = build(None, "/image_raw")
        return Graph(None, tuple(node for node in whole.nodes if node.name == declared.name))
    is_ours = declared.name in NODES.builtin and find_node(declared.name) is declared
    if is_ours and [*declared.stepped.values()] == [Image]:
        return build(None, "/image_raw", through=[declared])
    return Graph(None, (place(declared, {port: f"/{port}" for port in declared.inputs}),))
