"""Builder of graphs: the nodes that find landmarks, beside the others."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.data import (
    Detections,
    Image,
    Imu,
    Message,
    NavSatFix,
    Odometry,
    PoseWithCovarianceStamped,
    Transforms,
    TwistWithCovarianceStamped,
)
from ros_visualise.estimation.sensors import SENSORS
from ros_visualise.graph import IMAGE_NODES, SOURCE_TOPICS, Graph, Node, place
from ros_visualise.graph.visual_odometry import visual_odometry_of
from ros_visualise.nodes import find_node
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.simulation.worlds import WORLDS

log = logging.getLogger(__name__)

TAGS, OBJECTS, RECORDED_TAGS = "tag_detector", "landmark_detector", "tag_poses"
LOCALIZER, NAVIGATOR = "landmark_localizer", "landmark_navigator"
GEOREFERENCE, _TRACKER = "georeference", "tracker"
PLACES = "place_recognizer"
LANDING, POSE_ERROR = "landing_target", "pose_error"
DETECTORS = (TAGS, OBJECTS, RECORDED_TAGS)
"""The nodes that find landmarks in images, or convert those that others found."""

LANDING_INPUT = "landing_target_odom"
"""Input of a source: the pad that it is to land on."""

_ORIGIN, LENS, _STATED = "/map_origin", "/lens", "/initialpose"
_AMCL = "/amcl_pose"
_NO_POSES = (
    "--geo: needs {}, which this source lacks: positions and attitudes, as in pictures of drones, a"
    " video with KLV, or a log beside it"
)

_OBJECTS = {
    "detections": "/objects",
    "debug_image": "/objects_image",
    "vision_info": "/vision_info",
}
"""Outputs of the detector of objects beside one of tags."""

_REAL = ("camera_k1", "camera_readout", "camera_exposure", "tag_dirt")
"""Parameters of a simulated camera, other than 0 if its pictures are unlike ideal ones."""

Settings = Mapping[str, Mapping[str, Any]]


def with_tags(graph: Graph, wanted: bool | None, navigate: str | None) -> Graph:
    """The same graph with nodes that detect tags in the images that are processed.

    Args:
        graph: of a pipeline.
        wanted: map the tags; None: of a simulated robot alone.
        navigate: the map to localize the robot in, empty for a new one; None: do not.

    Raises:
        UsageError: no images, or as `with_landmarks`.
    """
    first = next((node for node in graph.nodes if node.name == IMAGE_NODES[0]), None)
    if wanted is None:
        wanted = first is not None and _is_simulated(graph)
    if not wanted and navigate is None:
        return graph
    found = _first(graph, Detections)
    if first is not None:
        graph = with_landmarks(
            graph, [first.inputs["image"]], [TAGS], navigate=navigate is not None
        )
    elif found and navigate is not None:
        graph = with_landmarks(graph, [found], [RECORDED_TAGS], navigate=True)
    else:
        what = "landmarks" if navigate is None else "navigation"
        raise UsageError(f"{what}: needs images, which this source lacks")
    if navigate:
        return graph.configured({NAVIGATOR: {"map": navigate, "mode": "frozen"}})
    return graph


def with_landmarks(
    graph: Graph,
    topics: Sequence[str],
    detectors: Sequence[str],
    settings: Settings = MappingProxyType({}),
    navigate: bool = False,
    on_earth: bool | None = None,
    follow: bool = False,
) -> Graph:
    """The same graph with nodes that find landmarks; where there are frames, also map them.

    In a simulated world the sizes of its tags are known. A robot that lands by its camera is given
    the pose of its landing pad.

    Args:
        graph: of any kind.
        topics: images, or detections made elsewhere, of each camera. Localizer and navigator take
            the first one.
        detectors: the nodes that take each.
        settings: type of node -> its parameters.
        navigate: localize the robot in the map, instead of trusting the frames.
        on_earth: place them on the Earth; None: where fixes and frames allow it, unless simulated.
        follow: give objects ids over time before they are placed.

    Raises:
        UsageError: one of their topics exists, no odometry to correct, no such parameter, or a
            value out of its range.
    """
    found = [_placed(name, topics[0]) for name in detectors]
    inputs = {
        "objects" if one.name == OBJECTS else "detections": one.outputs["detections"]
        for one in found
    }
    found += [
        _numbered(_placed(name, topic), number)
        for number, topic in enumerate(topics[1:], 2)
        for name in detectors
    ]
    odometry = _first(graph, Odometry, "/odom")
    beside = inputs | ({"odom": odometry} if odometry else {})
    if navigate:
        graph, navigating = _navigating(graph, inputs, odometry)
        found += navigating
    elif has_frames(graph):
        found.append(place(find_node(LOCALIZER), beside))
    if has_frames(graph) and graph.source is not None and LANDING_INPUT in graph.source.inputs:
        found = _with_landing(found, beside)
    earth = _first(graph, NavSatFix) is not None and has_frames(graph)
    if on_earth or (on_earth is None and earth and not _is_simulated(graph)):
        found += _on_earth(graph, inputs, topics[0] if follow else "")
    for made in (made for node in found for made in node.topics if made in graph.topics):
        raise UsageError(
            f"the recording already has {made}: exclude it with --topics, or omit --landmarks"
        )
    whole = graph.joined(*found)
    if TAGS in (node.name for node in found) and _is_simulated(graph) and graph.source is not None:
        whole = whole.configured({TAGS: _of_simulation(graph.source.params)})
    return whole.configured({node.name: settings.get(node.type.name, {}) for node in found})


def with_places(graph: Graph, topic: str, save_to: str) -> Graph:
    """The same graph with a `place_recognizer` for a topic of images, and the file that it saves.

    Raises:
        UsageError: nothing says how the robot moves, or there are no images.
    """
    odometry = _first(graph, Odometry, "/odom")
    if odometry is None or not has_frames(graph) or graph.topics[topic].type is not Image:
        raise UsageError(
            "--places: needs images, odometry in metres, and tf; this source lacks some of these"
        )
    node = place(find_node(PLACES), {"image": topic, "odometry": odometry})
    return graph.joined(node).configured({PLACES: {"save_to": save_to}})


def with_known_places(graph: Graph) -> Graph:
    """The same graph; its navigator takes the places of a `place_recognizer`, if it has both.

    The two share a map.
    """
    found = [one.outputs["places"] for one in graph.nodes if one.type.name == PLACES]
    if not found:
        return graph
    nodes = [
        replace(one, inputs={**one.inputs, "places": found[0]})
        if one.type.name == NAVIGATOR and "places" not in one.inputs
        else one
        for one in graph.nodes
    ]
    maps = [getattr(one.params, "map", "") for one in nodes if one.type.name == NAVIGATOR]
    graph = replace(graph, nodes=tuple(nodes))
    for one in graph.nodes if any(maps) else ():
        if one.type.name == PLACES:
            graph = graph.configured({one.name: {"map": maps[0]}})
    return graph


def _with_landing(found: Sequence[Node], inputs: Mapping[str, str]) -> list[Node]:
    """The nodes and the one that lands; its pad may move, so that it is no landmark."""
    landing = place(find_node(LANDING), inputs)
    still, mapping = {"moving": landing.params.target}, (LOCALIZER, NAVIGATOR)
    return [*(one.configured(still) if one.name in mapping else one for one in found), landing]


def _of_simulation(params: Any) -> dict[str, Any]:
    """Parameters of a tag detector: the tags of a simulated world, and its camera."""
    known = {"tags": tags_of_world(params.world), "readout": params.camera_readout}
    return known | ({"corner_floor": 0.0} if _is_ideal(params) else {})


def detectors_of(graph: Graph) -> list[Node]:
    """The nodes that find landmarks in images, or convert those that others found."""
    return [node for node in graph.nodes if node.type.name in DETECTORS]


def tags_of_world(name: str) -> str:
    """The file with the sizes of a simulated world's tags; raises UsageError if unknown."""
    return str(WORLDS.find(name).tags)


def has_frames(graph: Graph) -> bool:
    """True if the pose of its camera is published."""
    return bool(graph.topics_of(Transforms))


def _is_ideal(camera: Any) -> bool:
    """True if a simulated camera has no errors that its images hide."""
    return not any(getattr(camera, name, 0) for name in _REAL)


def _is_simulated(graph: Graph) -> bool:
    return graph.source is not None and graph.source.name in ROBOTS.names()


def _placed(name: str, topic: str) -> Node:
    """A detector on that topic."""
    declared = find_node(name)
    outputs = _OBJECTS if name == OBJECTS else None
    return place(declared, dict.fromkeys(declared.stepped, topic), outputs)


def _numbered(node: Node, number: int) -> Node:
    """A node of a further camera, with a name and topics of its own."""
    outputs = {port: f"{topic}_{number}" for port, topic in node.outputs.items()}
    return replace(node, name=f"{node.name}_{number}", outputs=outputs)


def _leaving_odom(graph: Graph) -> Graph:
    """The same; a simulated robot leaves it to the navigator to publish map -> odom."""
    source = graph.source
    if source is None or not hasattr(source.params, "map_to_odom"):
        return graph
    return graph.configured({source.name: {"map_to_odom": False}})


def _navigating(
    graph: Graph, inputs: Mapping[str, str], odometry: str | None
) -> tuple[Graph, list[Node]]:
    """The same graph, and the nodes that localize its robot by landmarks."""
    visual = visual_odometry_of(graph)
    graph = graph if visual else _leaving_odom(graph)
    navigator = _navigator(graph, inputs, visual or odometry)
    if visual:  # which has used the IMU
        navigator = navigator.configured({"imu": False})
    return graph, [navigator, *_pose_error(graph, navigator)]


def _navigator(graph: Graph, inputs: Mapping[str, str], odometry: str | None) -> Node:
    """The node that corrects the odometry by landmarks, and by all other sensors it knows."""
    if odometry is None or not has_frames(graph):
        what = "odometry" if odometry is None else "tf, with the camera's pose"
        raise UsageError(f"--navigate: needs {what}, which this source lacks")
    imu = _first(graph, Imu, SOURCE_TOPICS["imu"])
    found = {"imu": imu} if imu else {}
    stated = _stated(graph)
    found |= {"initialpose": stated} if stated else {}
    for sensor in SENSORS.all():
        topics = graph.topics_of(sensor.message)
        own = [topic for topic in topics if topic.endswith(f"/{sensor.topic}")]
        alone = topics[:1] if sensor.message is not TwistWithCovarianceStamped else []
        if own or alone:
            found[sensor.name] = [*own, *alone][0]
    return place(find_node(NAVIGATOR), {**inputs, "odometry": odometry, **found})


def _stated(graph: Graph) -> str | None:
    """The topic of initial poses; None if a recording has them for AMCL, in a map of its own."""
    topics = graph.topics_of(PoseWithCovarianceStamped)
    stated, by_amcl = (
        next((one for one in topics if one.endswith(end)), None) for end in (_STATED, _AMCL)
    )
    if not (stated and by_amcl) or graph.live:
        return stated
    log.warning(
        "ignoring %s: it was for AMCL, which published %s in a map of its own; to state where the"
        " robot starts, use --set landmark_navigator.start=x,y,z,yaw",
        stated,
        by_amcl,
    )
    return None


def _on_earth(graph: Graph, inputs: Mapping[str, str], followed: str) -> list[Node]:
    """The nodes that place landmarks on the Earth; objects followed in a topic of images, if any.

    Raises:
        UsageError: nothing says where the camera is.
    """
    if not (followed and "objects" in inputs):
        return [_georeference(graph, inputs)]
    seen = {"detections": inputs["objects"], "image": followed}
    tracker = place(find_node(_TRACKER), seen)
    return [tracker, _georeference(graph, {**inputs, "objects": tracker.outputs["tracks"]})]


def _georeference(graph: Graph, inputs: Mapping[str, str]) -> Node:
    """The node that places landmarks on the Earth.

    Raises:
        UsageError: nothing says where the camera is.
    """
    fixes = [topic for topic in graph.topics_of(NavSatFix) if not topic.endswith(_ORIGIN)]
    if not fixes:
        raise UsageError(_NO_POSES.format("fixes"))
    taken = {"fix": fixes[0], **inputs}
    for port, name in {"map_origin": _ORIGIN, "lens": LENS}.items():
        found = [topic for topic in graph.topics if topic.endswith(name)]  # below a source's name
        taken |= {port: found[0]} if found else {}
    return place(find_node(GEOREFERENCE), taken)


def check_poses(graph: Graph, beside: Sequence[str] = ()) -> None:
    """Raises UsageError if landmarks are placed on the Earth with no attitude of the camera.

    ``beside``: files beside a film that should give its poses.
    """
    for node in graph.nodes:
        if node.type.name == GEOREFERENCE and not (has_frames(graph) or node.params.course):
            hint = ", or derive the attitude from the course with --set georeference.course=true"
            why = _NO_POSES.format("tf")
            if beside:
                why = f"--geo: no valid positions with attitudes in {', '.join(beside)}"
                why += "; give another log with --beside"
            raise UsageError(why + hint)


def _pose_error(graph: Graph, navigator: Node) -> list[Node]:
    """The node that compares its pose with the true one, if that is known."""
    truth = graph.topics.get(SOURCE_TOPICS["truth"])
    if truth is None or truth.type is not Odometry:
        return []
    inputs = {"pose": navigator.outputs["pose"], "truth": SOURCE_TOPICS["truth"]}
    return [place(find_node(POSE_ERROR), inputs)]


def _first(graph: Graph, type: type[Message], name: str = "") -> str | None:
    """A topic of that type: the one of that name, else the first."""
    topics = graph.topics_of(type)
    return name if name in topics else next(iter(topics), None)
