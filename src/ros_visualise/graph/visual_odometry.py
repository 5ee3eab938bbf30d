"""Builder of graphs: odometry by the images of a source, for a navigator to correct."""

from __future__ import annotations

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Imu, Message, NavSatFix, Odometry, Transforms
from ros_visualise.graph import IMAGE_NODES, SOURCE_TOPICS, Graph, place
from ros_visualise.nodes import find_node

VISUAL_ODOMETRY = "visual_odometry"
_REST_S = 1.0


def with_visual_odometry(graph: Graph, wanted: bool | None, navigate: bool) -> Graph:
    """The same graph with a node that estimates the robot's motion from the images.

    Where the source has an odometry of its own, that one's transforms place the robot, as a frame
    has one parent.

    Args:
        graph: of a pipeline.
        wanted: add it; None: to navigate without another odometry, if an IMU gives the scale.
        navigate: a navigator needs odometry.

    Raises:
        UsageError: it is wanted, and there are no images.
    """
    processed = next((node for node in graph.nodes if node.name == IMAGE_NODES[0]), None)
    sensors = {
        "imu": _first(graph, Imu, SOURCE_TOPICS["imu"]),
        "reference": _first(graph, Odometry, "/odom"),
        "fix": _first(graph, NavSatFix, "/fix"),
    }
    if wanted is None:
        wanted = navigate and not sensors["reference"] and bool(sensors["imu"]) and bool(processed)
    if not wanted:
        return graph
    if processed is None:
        raise UsageError("--visual-odometry: needs images, which this source lacks")
    inputs = {port: topic for port, topic in sensors.items() if topic}
    inputs["image"] = processed.inputs["image"]
    node = place(find_node(VISUAL_ODOMETRY), inputs)
    if sensors["reference"] and graph.topics_of(Transforms):
        outputs = {port: topic for port, topic in node.outputs.items() if port != "tf"}
        node = place(node.type, inputs, outputs)
    return _resting(graph).joined(node)


def _resting(graph: Graph) -> Graph:
    """The same; a simulated robot rests before its mission, so that the odometry can start."""
    source = graph.source
    if source is None or not hasattr(source.params, "mission_delay"):
        return graph
    return graph.configured({source.name: {"mission_delay": _REST_S}})


def visual_odometry_of(graph: Graph) -> str | None:
    """The topic of an odometry by images, if there is one."""
    nodes = (node for node in graph.nodes if node.type.name == VISUAL_ODOMETRY)
    return next((node.outputs["odometry"] for node in nodes), None)


def _first(graph: Graph, kind: type[Message], usual: str) -> str:
    """The usual topic of that class, else the first that is no ground truth, else none."""
    truths = SOURCE_TOPICS["truth"], SOURCE_TOPICS["pad"]
    topics = [topic for topic in graph.topics_of(kind) if topic not in truths]
    return usual if usual in topics else next(iter(topics), "")
